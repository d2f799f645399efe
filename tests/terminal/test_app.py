"""The monitor as it looks: sizes of the terminal, hostile names, colours."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from kit.command import START
from kit.judged import registry
from kit.monitor import SMALL, WIDE, Script, board_of, look, named, of_device, session, status, text_of, trouble, use
from kit.simulated import faulted

from analyzer.board.board import Board
from dissectors.times import SECOND

if TYPE_CHECKING:
    from textual.pilot import Pilot

    from analyzer.board.snapshot import Snapshot
    from analyzer.terminal.app import Monitor


def test_everything_important_is_seen_at_80_by_24() -> None:
    lines = look(session("mission-8-faults.log"))
    assert [len(line) for line in lines] == [80] * 24
    first = lines[0]
    assert "can0" in first
    assert "REC a.mcap 12.3MB 4242 fr" in first
    assert "load 29%" in first
    assert "lost 0" in first
    assert "1 errors" in first
    row = of_device(lines, "3")
    assert row[:7] == ["3", "48.1", "9.5", "117.8", "2360", "52.0", "52"]
    assert row[7:] == ["operating", "mos", "over", "temperature", "<0.1s"]
    assert all(of_device(lines, str(k)) for k in range(1, 9))
    page = "\n".join(lines)
    assert "TRF-010 node 13" in page
    assert "Since the start" in page
    assert "2 flags set" in page
    assert " 10 " in page
    assert "? help" in lines[-1]


def test_a_wide_terminal_shows_ranges_pauses_and_nodes() -> None:
    lines = look(session("hover-4.log"), WIDE)
    row = of_device(lines, "1")
    assert row[1:3] == ["49.0", "47.8..50.2"]
    assert row[-3:] == ["<0.1s", "33ms", "11"]
    assert any("org.example.ground_station" in line for line in lines)
    assert {len(line) for line in lines} == {200}


@pytest.mark.sampled(2)
@pytest.mark.parametrize("size", [(60, 24), (40, 12), (20, 8), (10, 3), (1, 1), (132, 40)])
def test_it_is_drawn_in_any_size(size: tuple[int, int]) -> None:
    lines = look(session("mission-8-faults.log"), size)
    assert len(lines) == size[1]
    assert {len(line) for line in lines} == {size[0]}


def test_at_60_columns_values_flags_and_losses_are_there() -> None:
    state = session("mission-8-faults.log")
    lines = look(replace(state, buses=(replace(state.buses[0], dropped=17),)), (60, 24))
    assert "LOST 17" in lines[0]
    row = of_device(lines, "3")
    assert row[:5] == ["3", "48.1", "9.5", "117.8", "2360"]
    assert {"operating", "mos"} < set(row)


@pytest.mark.slow
@pytest.mark.parametrize("escs", [1, 20])
def test_any_number_of_devices(escs: int) -> None:
    board, now = board_of(faulted(escs=escs, seconds=1.5).text.encode())
    lines = look(board.snapshot(now), WIDE)
    assert all(of_device(lines, str(k)) for k in range(1, escs + 1))
    small = look(board.snapshot(now), SMALL, "end")
    assert of_device(small, str(escs))


@pytest.mark.slow
def test_no_device_and_nothing_at_all() -> None:
    board, now = board_of(text_of(status(7, 0, START)))
    assert any("none heard yet" in line for line in look(board.snapshot(now)))
    assert "waiting for the bus" in look(None)[0]
    lines = look(Board(registry(), {"can0": None}).snapshot(START))
    assert any("silent" in line for line in lines)
    assert "not recording" in lines[0]


def test_it_says_when_there_is_more_than_it_follows() -> None:
    page = "\n".join(look(replace(session("hover-4.log"), beyond=12)))
    assert "12 more than there is room for" in page


def test_names_from_the_bus_cannot_style_or_command_the_terminal() -> None:
    board, now = board_of(text_of([*named(7, b"[red]x[/]\x1b[2J\x07"), *status(7, 0, START + SECOND)]))
    board.note("can9: \x1b[31m[bold]down[/]", now)
    board.take_findings([trouble("TRF-010", node=7, text="[blink]\x9b2J")], now)
    page = "\n".join(look(board.snapshot(now), WIDE))
    assert "[red]x[/]\\x1b[2J\\x07" in page
    assert "\\x1b[31m[bold]down[/]" in page
    assert "[blink]\\x9b2J" in page
    assert all(c.isprintable() or c == "\n" for c in page)


def test_a_new_note_is_shown_in_place_of_the_keys() -> None:
    state = session("hover-4.log")
    assert "can0: link down" in look(replace(state, notes=((state.now - SECOND, "can0: link down"),)))[-1]
    assert "? help" in look(replace(state, notes=((state.now - 60 * SECOND, "can0: link down"),)))[-1]


def colours_of(state: Snapshot) -> set[str]:
    """The kinds of colours on the terminal."""
    found: set[str] = set()

    async def does(app: Monitor, _pilot: Pilot[None]) -> None:
        styles = [segment.style for strip in app.screen._compositor.render_strips() for segment in strip]
        used = [colour for style in styles if style for colour in (style.color, style.bgcolor) if colour]
        found.update(colour.type.name for colour in used)

    use(Script([state]), does)
    return found


def test_only_sixteen_colours_are_used() -> None:
    assert colours_of(session("mission-8-faults.log")) == {"STANDARD"}


def test_none_is_used_where_nobody_wants_colours(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NO_COLOR", "1")
    assert colours_of(session("mission-8-faults.log")) == {"DEFAULT"}
