"""The menu, sorted lists, the columns of rules and labels, comments that a capture holds itself."""

from __future__ import annotations

import asyncio
import shutil
from typing import TYPE_CHECKING

from kit.browsing import Seen, browser, capture

from analyzer.app.browse.session import BrowseOptions
from analyzer.browser import sorted_rows, view
from analyzer.browser.screen.list_pane import PacketList
from analyzer.browser.screen.pages.help import help_page
from analyzer.browser.screen.pages.menu import MenuPage
from analyzer.cli import main

if TYPE_CHECKING:
    from pathlib import Path

    import pytest

FAULTS, SERVICES = capture("mission-8-faults.log"), capture("services.log")


def numbers(seen: Seen) -> list[int]:
    """Return the frames of the rows that are seen."""
    lines = seen.app.list.text.splitlines()[1:]
    return [int(line[1:11].strip("x!~ ")) for line in lines if line.strip()]


async def select(seen: Seen, name: str) -> None:
    app = seen.app
    await seen.until(lambda: app.shown is not None)
    app.details.select(next(k for k, line in enumerate(app.shown.lines) if line.name == name))
    await seen.pilot.pause()


def test_rules_stand_at_the_right_end() -> None:
    async def work() -> None:
        async with browser(FAULTS) as seen:
            await seen.press("g")
            await seen.type("5711")
            lines = seen.app.list.text.splitlines()
            assert lines[0].endswith(" Rule")
            assert next(line for line in lines if " 5711 " in line).endswith("TRF-003")
            assert max(map(len, lines)) <= 80
            assert "TRF-003" in seen.app.copied("text")
            await seen.press("home", "slash")
            await seen.type("trf-003")
            await seen.until(lambda: not seen.app.wanted)
            assert "5711" in seen.row

    asyncio.run(work())


def test_the_menu_offers_what_can_be_done() -> None:
    async def work() -> None:
        async with browser(FAULTS, judged=False) as seen:
            await select(seen, "ESCStatus.voltage")
            await seen.press("space")
            assert "apply as filter  ESCStatus.voltage == 50.125" in seen.screen
            assert "follow esc  ch == 1" in seen.screen
            await seen.press("escape")
            assert "apply as filter" not in seen.screen
            await seen.press("f10", "down", "enter")
            await seen.until(lambda: seen.app.view.filter == "!(ESCStatus.voltage == 50.125)")
            await seen.press("escape", "home")
            await select(seen, "ESCStatus.voltage")
            await seen.press("space", "i")
            await seen.until(lambda: seen.app.view.pages.columns is not None)
            assert seen.app.view.pages.columns.names == ("ESCStatus.voltage",)
            await seen.press("space")
            at = next(k for k, line in enumerate(seen.screen.splitlines()) if " fn " in line)
            await seen.pilot.click("#page", offset=(10, at))
            await seen.pilot.pause()
            await seen.until(lambda: seen.app.view.filter == "node == 11")

    asyncio.run(work())


def test_the_right_button_asks_about_the_column() -> None:
    async def work() -> None:
        async with browser(FAULTS, judged=False) as seen:
            head = seen.app.list.text.splitlines()[0]
            for word, filter_text in (("Src", "dronecan.src == 11"), ("Type", "PUSHCAN"), (" ID", "transfer_id == 0")):
                await seen.pilot.click("#list", offset=(head.index(word) + 1, 2), button=3)
                await seen.pilot.pause()
                assert filter_text in seen.screen.splitlines()[1], word
                await seen.press("escape")
            await seen.pilot.click("#details", offset=(8, 2), button=3)
            await seen.pilot.pause()
            assert "copy the value" in seen.screen

    asyncio.run(work())


def test_a_tab_has_a_menu_too() -> None:
    async def work() -> None:
        async with browser(FAULTS) as seen:
            await seen.press("2", "down", "down", "space")
            assert 'apply as filter  finding.rule == "TRF-003" && node == 12' in seen.screen
            await seen.press("E")
            await seen.until(lambda: "TRF-003  A frame was lost" in seen.screen)

    asyncio.run(work())


def test_rows_are_sorted_by_a_field_and_by_a_column() -> None:
    async def work() -> None:
        async with browser(FAULTS, judged=False) as seen:
            app = seen.app
            await seen.filtered("ESCStatus")
            await select(seen, "ESCStatus.voltage")
            for falling in (False, True):
                await seen.press("S")
                await seen.until(lambda: app._unsorted is None or (app.look() and False))
                rows = [app.view.row(k) for k in range(len(app.view.rows))]
                shown = [
                    next(line for line in app.view.shown(row).lines if line.name == "ESCStatus.voltage")
                    for row in rows[:20]
                ]
                values = [float(line.value.split()[0]) for line in shown]
                assert values == sorted(values, reverse=falling)
                assert len(rows) == 1077
                assert len({row[:2] for row in rows}) == 1077
                assert app.view.number() == 0
            await seen.press("g")
            await seen.type("5702")
            assert "5702" in seen.row
            await seen.press("S")
            assert app.view.order is None
            assert "5702" in seen.row
            head = app.list.text.splitlines()[0]
            await seen.pilot.click("#list", offset=(head.index("Src") + 1, 0))
            await seen.until(lambda: app.view.order.done)
            app.look()
            assert app.view.sender(app.view.row(0))["src"] == 11
            assert app.view.sender(app.view.row(1076))["src"] == 18
            await seen.press("escape")
            assert app.view.order is None
            assert app.view.filter == "ESCStatus"

    asyncio.run(work())


def test_too_many_rows_are_not_sorted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(view, "MOST_SORTED", 1000)
    monkeypatch.setattr(view, "MOST_NAMED", 10)
    assert sorted_rows.MOST_SORTED > 1000

    async def work() -> None:
        async with browser(FAULTS, judged=False) as seen:
            await select(seen, "ESCStatus.voltage")
            await seen.press("S")
            assert "too many to sort (1,000): a filter first" in seen.said
            await seen.filtered('ESCStatus.mode == "idle"')
            await select(seen, "dronecan.src")
            await seen.press("S")
            await seen.until(lambda: seen.app.view.order.done)
            await seen.press("home", "v", "end", "y", "f")
            assert "of a sorted list 10 rows" in seen.said

    asyncio.run(work())


def test_labels_of_a_vehicle_stand_in_list_and_details(tmp_path: Path) -> None:
    vehicle = tmp_path / "vehicle.toml"
    vehicle.write_text('[node.11]\nlabel = "front left"\n[node.10]\nlabel = "pilot \\u001b[31m"\n')

    async def work() -> None:
        async with browser(FAULTS, judged=False, vehicle=str(vehicle)) as seen:
            assert "Label" in seen.app.list.text.splitlines()[0]
            assert " front left   ESCStatus" in seen.row
            assert "\x1b" not in seen.screen
            await select(seen, "dronecan.src")
            assert 'source node: 11 "front left"' in seen.screen
            await seen.press("number_sign")
            assert "front left" not in seen.app.list.text
            await seen.press("number_sign", "home", "slash")
            await seen.type("PILOT")
            await seen.until(lambda: not seen.app.wanted)
            assert "RawCommand" in seen.row

    asyncio.run(work())


def test_comments_of_a_capture_are_shown_and_kept_in_copies(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "flight.log"
    shutil.copy(FAULTS, path)
    (tmp_path / "flight.log.marks.toml").write_text(
        '[[mark]]\nframe = 5711\ntext = "schön \\u001b[31m"\n[[mark]]\nframe = 5712\ntext = "here, too"\n'
    )
    foreign, copy = tmp_path / "foreign.pcapng", tmp_path / "copy.pcapng"
    assert main(["convert", str(path), str(foreign)]) == 0
    assert main(["convert", str(foreign), str(copy)]) == 0
    assert foreign.read_bytes() == copy.read_bytes()
    capsys.readouterr()
    for more in ((), ("--frame-list",), ("--around", "5711+-1ms"), (str(copy), "--same-bus")):
        main(["decode", str(foreign), "--no-pager", *more])
        said = [line.strip() for line in capsys.readouterr().out.splitlines() if line.startswith(" " * 11 + "# ")]
        assert said == ["# schön \\x1b[31m", "# here, too"], more

    async def work() -> None:
        async with browser(foreign, judged=False) as seen:
            await seen.press("right_parenthesis")
            assert "5711" in seen.row
            assert "schön" in seen.said
            assert seen.app.shown.lines[0].text.startswith("Comment: schön")
            assert any(line.startswith("c") for line in seen.app.list.text.splitlines())
            await seen.press("M")
            assert seen.app.bar.value.startswith("schön")

    asyncio.run(work())


def test_what_wireshark_users_try(tmp_path: Path) -> None:
    path = tmp_path / "flight.log"
    shutil.copy(FAULTS, path)

    async def work() -> None:
        async with browser(path, judged=False, options=BrowseOptions()) as seen:
            app = seen.app
            await seen.press("enter")
            assert app.focused is app.details
            await seen.filtered("ESCStatus")
            await seen.press("enter", "escape")
            assert app.focused is app.list
            assert app.view.filter == "ESCStatus"
            await seen.press("escape")
            assert app.view.filter == ""
            await seen.pilot.click("#state", offset=(5, 0))
            await seen.pilot.pause()
            assert app.focused is app.bar
            await seen.press("escape", "home", "v", "down", "down", "m")
            assert sorted(app.view.marks.marks) == [0, 3, 8]
            await seen.press("escape", "home")
            assert app.copied("bytes") == "0010220944527b2c024d00000000"
            await seen.press("ctrl+a")
            assert len(app.view.selected()) == len(app.view.rows)
            await seen.press("escape", "2")
            line = seen.screen.splitlines()[-1]
            assert line.startswith(" 1 packets  2 findings")
            await seen.pilot.click("#bottom", offset=(line.index("7"), 0))
            await seen.pilot.pause()
            assert app.tab == "notes"

    asyncio.run(work())


def test_a_column_of_ones_own_goes_by_the_right_button() -> None:
    async def work() -> None:
        async with browser(FAULTS, (120, 30), judged=False) as seen:
            app = seen.app
            for name in ("ESCStatus.voltage", "ESCStatus.current"):
                await select(seen, name)
                await seen.press("i")
            head = app.list.text.splitlines()[0]
            await seen.pilot.click("#list", offset=(head.index("voltage") + 2, 0))
            await seen.until(lambda: app.view.order is not None)
            assert app.view.order.name == "ESCStatus.voltage"
            await seen.pilot.click("#list", offset=(head.index("voltage") + 2, 0), button=3)
            await seen.pilot.pause()
            assert app.view.pages.columns.names == ("ESCStatus.current",)

    asyncio.run(work())


def test_clicks_that_come_at_once_open_one_page_and_leave_it_once() -> None:
    async def work() -> None:
        async with browser(FAULTS) as seen:
            app = seen.app
            for _ in range(2):
                app.list.post_message(PacketList.Asked("info"))
            await seen.until(lambda: isinstance(app.screen, MenuPage))
            await seen.pilot.pause()
            assert len(app.screen_stack) == 2
            below = app.screen
            app.push_screen(help_page())
            below.leave()
            await seen.press("escape", "escape")
            assert len(app.screen_stack) == 1
            await seen.press("end")
            assert app.view.number() == len(app.view.rows) - 1

    asyncio.run(work())


def test_a_type_has_no_order() -> None:
    async def work() -> None:
        async with browser(FAULTS) as seen:
            lines = seen.app.shown.lines
            seen.app.details.select(next(k for k, line in enumerate(lines) if line.text.strip().startswith("Message")))
            await seen.press("S")
            assert "no field is selected to sort by" in seen.said
            assert seen.app.view.order is None

    asyncio.run(work())
