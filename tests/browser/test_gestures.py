"""The gestures, by keys, on a terminal that is not there."""

from __future__ import annotations

import asyncio
import json
import re
import shutil
from typing import TYPE_CHECKING

import pytest
from kit.browsing import browser, capture

from analyzer.app.browse.session import BrowseOptions
from analyzer.cli import main

if TYPE_CHECKING:
    from pathlib import Path

FAULTS, SERVICES = capture("mission-8-faults.log"), capture("services.log")


@pytest.mark.parametrize("size", [(80, 24), (200, 60), (40, 12)])
def test_three_panes_fit(size: tuple[int, int]) -> None:
    async def work() -> None:
        async with browser(FAULTS, size) as seen:
            lines = seen.screen.split("\n")
            assert len(lines) == size[1]
            assert max(map(len, lines)) <= size[0]
            assert "Frame" in seen.screen
            if size[0] >= 80:
                assert "Details" in seen.screen
                assert "Bytes" in seen.screen
                assert "10,220 frames" in lines[0]
                assert "!" in lines[1]

    asyncio.run(work())


def test_a_field_lights_its_bytes_and_a_byte_its_field() -> None:
    async def work() -> None:
        async with browser(FAULTS) as seen:
            app = seen.app
            index = next(k for k, line in enumerate(app.shown.lines) if line.name == "ESCStatus.voltage")
            app.details.select(index)
            await seen.pilot.pause()
            lit = app.bytes._lit
            assert lit.bits == frozenset(range(32, 48))
            assert lit.bytes == {(0, 6), (1, 0)}
            await seen.press("tab", "tab", "right")
            app.bytes.to((1, 1))
            await seen.pilot.pause()
            assert app.details.line.name == "ESCStatus.current"
            app.bytes.to((0, 0))
            await seen.pilot.pause()
            assert app.details.line.text.startswith("CRC")

    asyncio.run(work())


def test_apply_prepare_and_combine_a_field_as_filter() -> None:
    async def work() -> None:
        async with browser(FAULTS) as seen:
            app = seen.app

            async def select(name: str) -> None:
                await seen.until(lambda: app.shown is not None)
                app.details.select(next(k for k, line in enumerate(app.shown.lines) if line.name == name))

            await select("ESCStatus.status.mode")
            await seen.press("a")
            assert app.view.filter == "ESCStatus.status.mode == 1"
            await seen.until(lambda: app.view.rows.done)
            assert len(app.view.rows) == 12
            await select("dronecan.src")
            await seen.press("ampersand")
            assert app.view.filter == "(ESCStatus.status.mode == 1) && dronecan.src == 11"
            await seen.until(lambda: app.view.rows.done)
            assert len(app.view.rows) == 2
            await seen.press("escape")
            assert app.view.filter == ""
            await select("ESCStatus.voltage")
            await seen.press("p")
            assert app.bar.value == "ESCStatus.voltage == 50.125"
            assert app.view.filter == ""

    asyncio.run(work())


def test_a_wrong_filter_is_pointed_at_and_stays() -> None:
    async def work() -> None:
        async with browser(FAULTS) as seen:
            await seen.press("equals_sign")
            await seen.type("ESCStatus.voltag > 3")
            assert "^" in seen.said
            assert "voltag" in seen.said
            assert seen.app.bar.value == "ESCStatus.voltag > 3"
            assert seen.app.view.filter == ""

    asyncio.run(work())


def test_completion_and_history() -> None:
    async def work() -> None:
        async with browser(FAULTS) as seen:
            await seen.filtered("ESCStatus.rpm > 0")
            await seen.press("escape", "equals_sign", "up")
            assert seen.app.bar.value == "ESCStatus.rpm > 0"
            seen.app.bar.value, seen.app.bar.cursor_position = "ESCStatus.volt", 14
            await seen.press("tab")
            assert seen.app.bar.value == "ESCStatus.voltage"
            seen.app.bar.value, seen.app.bar.cursor_position = "ESCSt", 5
            await seen.press("tab")
            assert re.fullmatch(r" ESCStatus(?:  \S+)+ \.\.\. \d+ in all *", seen.said)

    asyncio.run(work())


@pytest.mark.parametrize("text", ["5711", "#5712", "2.504123", "08:02:12.50625"])
def test_go_to(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TZ", "UTC")

    async def work() -> None:
        async with browser(FAULTS, judged=False) as seen:
            await seen.press("g")
            await seen.type(text)
            assert int(seen.row[1:9]) == 5711

    asyncio.run(work())


def test_go_where_nothing_is() -> None:
    async def work() -> None:
        async with browser(FAULTS, judged=False) as seen:
            await seen.press("g")
            await seen.type("99999")
            assert "there is no frame 99,999: frames are 1 to 10,220" in seen.said
            await seen.press("g")
            await seen.type("gestern")
            assert "'gestern' is not a time" in seen.said

    asyncio.run(work())


@pytest.mark.parametrize("text", ["broken, 3 frames", "C7 08 00 40", '= dronecan.status == "interrupted"'])
def test_find_text_bytes_and_filters(text: str) -> None:
    async def work() -> None:
        async with browser(FAULTS, judged=False) as seen:
            await seen.press("slash")
            wanted = text if text != "C7 08 00 40" else "00 40 7F 3F FA"
            await seen.type(wanted)
            await seen.until(lambda: seen.app.search is not None and not seen.app.wanted)
            assert "5711" in seen.row
            await seen.press("n")
            await seen.until(lambda: not seen.app.wanted)

    asyncio.run(work())


def test_from_a_request_to_its_response_and_back() -> None:
    async def work() -> None:
        async with browser(SERVICES, judged=False) as seen:
            await seen.press("g")
            await seen.type("12")
            assert "GetNodeInfo" in seen.row
            await seen.press("r")
            assert seen.row.split()[0] == "13"
            await seen.press("r")
            assert seen.row.split()[0] == "12"
            await seen.press("f", "x")
            assert seen.app.view.filter == "GetNodeInfo && node == 127 && node == 42"

    asyncio.run(work())


def test_follow_node_channel_and_unit() -> None:
    async def work() -> None:
        async with browser(FAULTS, judged=False) as seen:
            for key, text in (("n", "node == 11"), ("e", "ch == 1"), ("t", "ESCStatus && dronecan.src == 11")):
                await seen.press("f", key)
                assert seen.app.view.filter == text
                await seen.press("escape")
            await seen.press("home", "down", "f", "u")
            assert seen.app.view.filter == "unit == 1"

    asyncio.run(work())


def test_the_same_sender_before_and_behind() -> None:
    async def work() -> None:
        async with browser(FAULTS, judged=False) as seen:
            await seen.press("full_stop")
            assert seen.row[1:9].strip() == "65"
            await seen.press("comma")
            assert seen.row[1:9].strip() == "1"

    asyncio.run(work())


def test_findings_marks_and_comments(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "flight.log"
    shutil.copy(FAULTS, path)

    async def work() -> None:
        async with browser(path, options=BrowseOptions()) as seen:
            await seen.press("g")
            await seen.type("5000")
            await seen.press("right_square_bracket")
            first = seen.row
            assert seen.app.view.places_of(seen.app.view.current())
            await seen.press("m", "home", "right_parenthesis")
            assert seen.row == first
            await seen.press("M")
            await seen.type('it began "here"')
            assert "flight.log.marks.toml" in seen.said
        async with browser(path, options=BrowseOptions(), judged=False) as seen:
            await seen.press("right_parenthesis")
            assert 'it began "here"' in seen.said

    asyncio.run(work())
    assert 'it began \\"here\\"' in (tmp_path / "flight.log.marks.toml").read_text()
    assert main(["decode", str(path), "--no-pager"]) == 0
    listed = capsys.readouterr().out.splitlines()
    assert sum(line.endswith('it began "here"') and line.startswith(" " * 11 + "# ") for line in listed) == 1
    (tmp_path / "flight.log.marks.toml").write_text("[[mark]]\nframe = 0\n")
    assert main(["decode", str(path)]) == 2
    assert "mark 1: frame is a number from 1" in capsys.readouterr().err


def test_columns_times_and_references() -> None:
    async def work() -> None:
        async with browser(FAULTS, (120, 30), judged=False) as seen:
            app = seen.app
            app.details.select(next(k for k, line in enumerate(app.shown.lines) if line.name == "ESCStatus.voltage"))
            await seen.press("i")
            assert app.view.pages.columns.names == ("ESCStatus.voltage",)
            assert "50.125" in seen.row
            await seen.press("I")
            assert app.view.pages.columns is None
            await seen.press("home", "down", "t")
            assert "+0.000000" in seen.row
            await seen.press("home")
            assert "-0.000385" in seen.row
            await seen.press("down", "t", "T")
            assert app.view.pages.mode == "a"
            await seen.press("T", "T")
            assert app.view.pages.mode == "d"
            assert "0.000385" in seen.app.list.text

    asyncio.run(work())


def test_copy() -> None:
    async def work() -> None:
        async with browser(FAULTS, judged=False) as seen:
            app = seen.app
            assert json.loads(app.copied("JSON"))["frames"] == [1, 2, 3]
            assert app.copied("candump").splitlines()[0].endswith("can0 1F040A0B#7E56001022094480")
            assert app.copied("text").split()[0] == "1"
            await seen.press("y", "f")
            assert "copied:" in seen.said

    asyncio.run(work())


def test_tabs_lead_to_rows_and_filters() -> None:
    async def work() -> None:
        async with browser(FAULTS) as seen:
            await seen.press("2")
            assert "TRF-003" in seen.screen
            await seen.press("down", "down", "enter")
            assert "5711" in seen.row
            await seen.press("2", "a")
            await seen.until(lambda: getattr(seen.app.view.rows, "done", True))
            assert seen.app.view.filter == 'finding.rule == "TRF-003" && node == 12'
            assert len(seen.app.view.rows) == 1
            await seen.press("escape")
            for key, word in (("3", "fault"), ("4", "flight"), ("5", "What broke first")):
                await seen.press(key)
                assert word in seen.screen
            await seen.press("s")
            await seen.type("talkers")
            await seen.until(lambda: seen.app.view.supply.tab("statistics") is not None)
            seen.app.look()
            await seen.pilot.pause()
            assert "RawCommand" in seen.screen
            await seen.press("down", "down", "enter")
            assert "dronecan.src" in seen.app.view.filter

    asyncio.run(work())


def test_the_strip_is_clicked_and_help_comes_and_goes() -> None:
    async def work() -> None:
        async with browser(FAULTS, judged=False) as seen:
            await seen.pilot.click("#strip", offset=(79, 0))
            await seen.pilot.pause()
            assert seen.app.view.number() > 3000
            await seen.press("question_mark")
            assert "Keys of tailbyte view" in seen.screen
            await seen.press("x")
            assert "Keys of tailbyte view" not in seen.screen
            await seen.pilot.click("#list", offset=(20, 3))
            await seen.pilot.pause()
            assert seen.app.view.number() == seen.app.list._top + 2

    asyncio.run(work())


def test_statistics_are_offered_and_rules_explained() -> None:
    async def work() -> None:
        async with browser(FAULTS) as seen:
            app = seen.app
            app.details.select(next(k for k, line in enumerate(app.shown.lines) if line.name == "ESCStatus.voltage"))
            await seen.press("y", "v")
            assert "copied: 50.125 V" in seen.said
            await seen.press("6")
            assert "values,ESCStatus.voltage" in seen.screen
            assert app.tabs.line.ask == "io"  # enter asks for the first at once
            await seen.press("down", "enter")
            await seen.until(lambda: not app.view.supply.asking)
            app.look()
            await seen.pilot.pause()
            assert "DroneCAN" in seen.screen
            await seen.press("2", "down", "down", "E")
            assert "TRF-003  A frame was lost" in seen.screen
            await seen.press("escape")
            assert "wrong toggle bit at the sender, before frame 5712" in seen.screen.replace("\n ", " ")

    asyncio.run(work())
