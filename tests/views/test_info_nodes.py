"""The nodes of a capture as `info` shows them: a row each, in 80 columns and in 200."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest
from kit import encode
from kit.command import CAPTURES
from kit.encode import log_line
from kit.traffic import log, status, throttle

from analyzer.facts.senders import SenderFacts
from analyzer.facts.summary import Facts, Summary
from analyzer.views.info import render
from analyzer.views.terminal import display_width

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from dissectors import Registry

NODE = SenderFacts(
    bus="can0", node=11, anonymous=False, name="com.acme.esc", roles=("ESC",), channels=(1,),
    software="V2.2.0-20250314-unstripped+debug", types=3, count=1000, known=1000, hz=61.04, bad=0, lost=0, restarts=0,
    first=None, last=None,
)  # fmt: skip


@pytest.fixture
def hover(decode: Callable[..., Any], registry: Registry) -> Facts:
    got, summary = decode((CAPTURES / "hover-4.log").read_bytes()), Summary(registry)
    for batch in got.batches:
        summary.feed(batch)
    return summary.finish([], got.engine)


def table(text: str) -> list[str]:
    """The rows of the nodes, and what stands below them."""
    return text[text.index("Node  Ch") :].partition("\n\n")[0].rstrip().split("\n")


def test_a_row_each(hover: Facts) -> None:
    head, *rows = table(render(hover))
    assert head.split() == ["Node", "Ch", "Role", "Software", "Hz", "Bad", "Lost", "Restart", "Seen"]
    assert [row.split()[:4] for row in rows] == [
        ["10", "-", "autopilot", "-"],
        *(["1" + str(k), str(k), "ESC", "V2.2.0-20250314"] for k in range(1, 5)),
        ["125", "-", "commands", "2.2"],
    ]
    assert all(row.split()[5:] == ["0", "0", "0", "all"] for row in rows)


def test_what_has_no_room_at_80_columns_stands_below(hover: Facts) -> None:
    odd = replace(NODE, node=12, odd=("rate", "restarts", "left early"), restarts=2, lost=123_456)
    facts = replace(hover, senders=(NODE, odd))
    narrow = table(render(facts))
    assert narrow[0].split() == ["Node", "Ch", "Role", "Hz", "Bad", "Lost", "Restart", "Seen", "Odd"]
    assert narrow[2].split()[:-4] == ["12", "1", "ESC", "61.0", "0", "123456", "2", "-"]
    assert narrow[3:] == ["Software V2.2.0-20250314-unstripped+debug: nodes 11, 12"]
    short = [replace(one, software="V2.2.0-20250314") for one in (NODE, odd)]
    _, _, row, below = table(render(replace(hover, senders=tuple(short))))
    assert (row.split()[3], below) == ("V2.2.0-20250314", "     odd: rate, restarts, left early")
    wide = table(render(facts, width=200))
    assert wide[0].split() == ["Node", "Ch", "Role", "Name", "Software", "Hz", "Bad", "Lost", "Restart", "Seen", "Odd"]
    assert wide[2].split()[:5] == ["12", "1", "ESC", "com.acme.esc", "V2.2.0-20250314-unstripped+debug"]
    assert wide[2].endswith("rate, restarts, left early")
    assert len(wide) == 3


@pytest.mark.parametrize("width", [80, 200])
def test_any_width_holds(hover: Facts, width: int) -> None:
    worst = replace(
        NODE, bus="slcan_of_a_very_long_name", node=127, name="\x1b[2J" * 20, software="\u202e" * 8, lost=10**9,
        bad=10**9, roles=("air data", "compass", "range finder"), count=10**9, hz=1e6,
        odd=("software", "rate", "came late"), first=hover.start, last=(hover.start or 0) + 10**9,
    )  # fmt: skip
    for buses in (hover.buses, hover.buses * 2):
        text = render(replace(hover, senders=(NODE, worst), buses=buses), types=True, width=width)
        assert max(map(display_width, text.splitlines())) <= width
        assert all(line.isprintable() for line in text.splitlines())


def test_many_nodes_are_cut_and_odd_ones_stay(hover: Facts) -> None:
    nodes = [replace(NODE, node=k, channels=()) for k in range(1, 128)]
    nodes[110] = replace(nodes[110], odd=("lost",))
    facts = replace(hover, senders=tuple(nodes))
    rows = table(render(facts))
    assert [int(row.split()[0]) for row in rows[1:40]] == list(range(1, 40))
    assert rows[40].split()[0] == "111"
    assert rows[42] == "and 87 more, none of them odd (--all)"
    assert len(table(render(facts, everything=True, width=200))) == 128


def test_several_buses_are_named(command: Callable[..., Any], tmp_path: Path) -> None:
    path = tmp_path / "two.log"
    frames = [replace(one, bus=f"can{k % 2}", t=one.t + k) for k in range(6) for one in throttle(k // 2).frames(10**18)]
    path.write_text("".join(log_line(one) + "\n" for one in frames))
    head, *rows = command("info", path)[1].partition("Bus   Node")[2].splitlines()[:3]
    assert head.split()[0] == "Ch"
    assert [row.split()[:2] for row in rows] == [["can0", "1"], ["can1", "1"]]
    senders = json.loads(command("info", path, "-T", "json")[1])["senders"]
    assert [(one["bus"], one["node"], one["count"], one["roles"]) for one in senders] == [
        ("can0", 1, 3, ["autopilot"]), ("can1", 1, 3, ["autopilot"]),
    ]  # fmt: skip


def test_unknown_and_foreign(command: Callable[..., Any], tmp_path: Path) -> None:
    unknown = [(20.0 * k, encode.Transfer("message", 20_710, 30, b"ab", 0, k)) for k in range(8)]
    path = tmp_path / "unknown.log"
    path.write_text(log(*unknown))
    text = command("info", path, "--types")[1]
    assert "\n  30   -  unknown  -" in text
    assert "\n  30   -  type 20710" in text
    assert "Unknown    type 20710 8x" in text
    path.write_text("(1.0) can0 123#11\n(2.0) can0 124#11\n")
    text = command("info", path, "--types")[1]
    assert "No DroneCAN transfers.\n" in text
    assert "Foreign    2 frames, ids 123 1x, 124 1x" in text


def test_types_are_shown_if_asked_for(command: Callable[..., Any], tmp_path: Path) -> None:
    path = tmp_path / "short.log"
    path.write_text(log((0.0, throttle(0)), (1.0, status(0))))
    assert "ESCStatus  " not in command("info", path)[1]
    text = command("info", path, "--types")[1]
    assert [line.split()[:4] for line in text.splitlines() if "Status  " in line or "Command  " in line] == [
        ["1", "-", "RawCommand", "1"], ["10", "3", "ESCStatus", "1"],
    ]  # fmt: skip


def test_days_are_told(hover: Facts) -> None:
    day = 86_400 * 10**9
    start = hover.start or 0
    one = replace(NODE, first=start + day, last=start + 2 * day)
    facts = replace(hover, senders=(one,), start=start, end=start + 3 * day)
    assert [len(word) for word in table(render(facts, width=200))[1].split()[-5:]] == [5, 5, 2, 5, 5]
