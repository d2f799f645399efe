"""Every key does what the page of keys says, the mouse too; what is kept is there the next time."""

from __future__ import annotations

import asyncio
import os
import signal
from types import SimpleNamespace
from typing import TYPE_CHECKING

import pytest
from kit.browsing import Seen, browser, capture
from textual.events import MouseScrollDown, MouseScrollUp

from analyzer.app.browse.session import BrowseOptions
from analyzer.app.browse.tools import BrowserTools
from analyzer.browser.screen.app import Browser
from analyzer.browser.screen.keys import EVERY, HINTS, KEYS, help_lines

if TYPE_CHECKING:
    from pathlib import Path

FAULTS = capture("mission-8-faults.log")


def place(row: str) -> int:
    return int(row[:11].strip("x*! "))


async def select(seen: Seen, name: str) -> None:
    await seen.until(lambda: seen.app.shown is not None)
    lines = seen.app.shown.lines
    seen.app.details.select(next(k for k, line in enumerate(lines) if line.name == name))
    await seen.pilot.pause()


def test_every_key_has_its_action_and_its_words() -> None:
    for action in [*(one.action for one in EVERY), *(action for _, action in HINTS)]:
        assert callable(getattr(Browser, f"action_{action.partition('(')[0]}")), action
    told = " ".join(called for called, _ in help_lines())
    for keys in KEYS.values():
        for one in keys:
            assert one.words or any(other.words and other.called.count(" ") for other in keys), one
            first = one.keys.split(",", maxsplit=1)[0]
            sign = {"slash": "/", "equals_sign": "=", "question_mark": "?", "minus": "-", "plus": "+"}.get(first, first)
            assert len(sign) > 1 or sign in told, one
    bound = [key for one in EVERY for key in one.keys.split(",")]
    assert len(bound) == len(set(bound))


def test_the_ways_back_lead_back() -> None:
    async def work() -> None:
        async with browser(FAULTS) as seen:
            for there, back in (("]", "["), ("right_curly_bracket", "left_curly_bracket")):
                await seen.press("g")
                await seen.type("3000")
                await seen.press(there)
                first = place(seen.row)
                await seen.press(there)
                assert place(seen.row) > first > 3000
                await seen.press(back)
                assert place(seen.row) == first
            await seen.press("m", "home", "m", "right_parenthesis")
            assert place(seen.row) == first
            await seen.press("left_parenthesis")
            assert place(seen.row) == 1
            await seen.press("left_parenthesis")
            assert "no mark before" in seen.said

    asyncio.run(work())


@pytest.mark.parametrize(
    ("keys", "wanted"),
    [
        (("a",), "dronecan.src == 11"),
        (("ampersand",), "(ESCStatus) && dronecan.src == 11"),
        (("vertical_line",), "(ESCStatus) || dronecan.src == 11"),
        (("exclamation_mark",), "(ESCStatus) && !(dronecan.src == 11)"),
        (("A", "s"), "dronecan.src == 11"),
        (("A", "o"), "(ESCStatus) || dronecan.src == 11"),
        (("A", "c"), "(ESCStatus) || !(dronecan.src == 11)"),
        (("P", "b", "enter"), "(ESCStatus) && !(dronecan.src == 11)"),
        (("p", "enter"), "dronecan.src == 11"),
    ],
)
def test_ways_of_a_filter(keys: tuple[str, ...], wanted: str) -> None:
    async def work() -> None:
        async with browser(FAULTS, judged=False) as seen:
            await seen.filtered("ESCStatus")
            await seen.press("home")
            await select(seen, "dronecan.src")
            await seen.press(*keys)
            assert seen.app.view.filter == wanted

    asyncio.run(work())


def test_parts_of_words_and_of_the_identifier_are_lit() -> None:
    async def work() -> None:
        async with browser(FAULTS, judged=False) as seen:
            await select(seen, "ESCStatus.status.mode")
            lit = seen.app.bytes._lit
            assert lit.bits == frozenset(range(8, 12))  # bits 12 to 15 of a word whose low byte comes first
            assert lit.bytes == {(0, 3)}
            assert "00010000" in seen.app.bytes.text.splitlines()[0]
            await select(seen, "dronecan.src")
            assert seen.app.bytes._lit.digits == frozenset({6, 7})
            assert not seen.app.bytes._lit.bytes

    asyncio.run(work())


def test_the_mouse_scrolls_and_clicks() -> None:
    async def work() -> None:
        async with browser(FAULTS, judged=False) as seen:
            app = seen.app
            for pane, at in ((app.list, app.view.number), (app.details, lambda: app.details._at)):
                before = at()
                for kind, step in ((MouseScrollDown, 3), (MouseScrollUp, 0)):
                    pane.post_message(kind(pane, 5, 2, 0, 1, 0, False, False, False))
                    await seen.pilot.pause()
                    assert at() == before + step, pane
            line = app.bytes.text.splitlines()[2]
            await seen.pilot.click("#bytes", offset=(line.index("52"), 2))
            await seen.until(lambda: app.focused is app.bytes and app.details.line.name == "ESCStatus.voltage")
            await seen.press("equals_sign")
            await seen.pilot.click("#list", offset=(20, 2))
            await seen.until(lambda: app.state.display and not app.bar.display)
            await seen.press("2")
            await seen.until(lambda: app.tabs.line is not None)
            await seen.pilot.click("#tab", offset=(10, 1))
            await seen.pilot.pause()
            assert app.tab in ("findings", "packets")

    asyncio.run(work())


def test_begin_at_a_frame_with_times_and_columns_of_the_command_line() -> None:
    async def work() -> None:
        options = BrowseOptions(at="5711", time="d", columns=("ESCStatus.rpm",), marks=False)
        async with browser(FAULTS, options=options, judged=False) as seen:
            await seen.until(lambda: not seen.app.start and place(seen.row) == 5711)
            assert "rpm" in seen.app.list.text.splitlines()[0]
            assert seen.app.view.pages.mode == "d"
        async with browser(FAULTS, options=BrowseOptions(at="2.504123", marks=False), judged=False) as seen:
            await seen.until(lambda: not seen.app.start)
            assert place(seen.row) == 5711

    asyncio.run(work())


def test_filters_and_columns_are_there_the_next_time() -> None:
    async def work() -> None:
        async with browser(FAULTS, judged=False) as seen:
            await seen.filtered("ESCStatus && ch == 3")
            await seen.filtered("RawCommand")
            await seen.press("escape", "home")
            await select(seen, "ESCStatus.voltage")
            await seen.press("i")
        async with browser(FAULTS, judged=False) as seen:
            assert seen.app.view.pages.columns.names == ("ESCStatus.voltage",)
            await seen.press("equals_sign", "up")
            assert seen.app.bar.value == "RawCommand"
            await seen.press("up")
            assert seen.app.bar.value == "ESCStatus && ch == 3"
            await seen.press("escape", "I")
        async with browser(FAULTS, judged=False) as seen:
            assert seen.app.view.pages.columns is None

    asyncio.run(work())


def test_what_is_typed_is_checked_as_it_comes() -> None:
    async def work() -> None:
        async with browser(FAULTS, judged=False) as seen:
            app = seen.app
            await seen.press("equals_sign")
            for text, wanted in (("ESCStatus.volt", {"bad"}), ("ESCStatus.voltage > 3", {"good"}), ("", set())):
                app.bar.value = text
                app.look()
                await seen.pilot.pause()
                assert {one for one in ("good", "bad") if app.bar.has_class(one)} == wanted, text

    asyncio.run(work())


def test_a_statistic_by_the_letter_of_decode_and_the_picture() -> None:
    async def work() -> None:
        async with browser(FAULTS, judged=False) as seen:
            asked: list[tuple[str, ...]] = []
            seen.app.tools._start = lambda words, *_: asked.append(tuple(words))
            await seen.press("g")
            await seen.type("5711")
            await seen.press("o")
            assert asked == [("plot", FAULTS, "--around", "5711+-2s")]
            for key, purpose in (("w", "write"), ("g", "go"), ("M", "comment"), ("slash", "find"), ("z", "statistic")):
                await seen.press("escape", key)
                assert seen.app.bar.purpose == purpose
                assert not seen.said.rstrip().endswith("…")  # it fits into 80 columns
            await seen.press(*"va", "tab", *",ESCStatus.vol", "tab")
            assert seen.app.bar.value == "values,ESCStatus.voltage"

    asyncio.run(work())


def test_names_of_files_that_are_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tools = BrowserTools(SimpleNamespace(paths=("-x.log",), arguments=("--same-bus",), window=("--from", "3")))  # type: ignore[arg-type]
    asked: list[tuple[object, ...]] = []
    monkeypatch.setattr(tools, "_start", lambda words, _done, _to, output: asked.append((words[0], words[-4:], output)))
    for name, command, output in (
        ("my rows.log", "convert", "/dev/null"), ("x.jsonl", "decode", str(tmp_path / "x.jsonl")),
        ("x.csv ESCStatus", "export", "/dev/null"), ("x.PCAPNG", "convert", "/dev/null"),
    ):  # fmt: skip
        tools.write(str(tmp_path / name), "ch == 1")
        assert asked.pop() == (command, ("--from", "3", "-Y", "ch == 1"), output)
    (tmp_path / "there.log").touch()
    for name, said in (("there.log", "exists already"), ("x.doc", r"\.jsonl"), ("x", "end in one of")):
        with pytest.raises(ValueError, match=said):
            tools.write(str(tmp_path / name), "")
    monkeypatch.undo()
    with pytest.raises(ValueError, match="No such file"):
        tools.write(str(tmp_path / "nowhere" / "x.json"), "")


@pytest.mark.slow
def test_rows_go_into_a_file_as_json(tmp_path: Path) -> None:
    async def work() -> None:
        async with browser(FAULTS, judged=False) as seen:
            await seen.filtered("ESCStatus && ch == 3")
            count = len(seen.app.view.rows)
            await seen.press("w")
            await seen.type(str(tmp_path / "some rows.jsonl"))
            await seen.until(lambda: bool(seen.app.tools.said) or "written" in seen.said)
            assert "written" in (*seen.app.tools.said, seen.said)[0]
            assert len((tmp_path / "some rows.jsonl").read_text().splitlines()) == count

    asyncio.run(work())


def test_a_terminal_of_ascii_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.__stdout__", SimpleNamespace(encoding="ANSI_X3.4-1968"))

    async def work() -> None:
        async with browser(FAULTS) as seen:
            for keys in ((), ("g",), ("space",), ("escape",), ("2",), ("5",), ("question_mark",)):
                await seen.press(*keys)
                assert seen.screen.isascii(), keys
                assert max(map(len, seen.screen.splitlines())) <= 80

    asyncio.run(work())


def test_a_type_is_no_field_to_sort_by() -> None:
    async def work() -> None:
        async with browser(FAULTS, judged=False) as seen:
            await seen.press("space")
            assert "apply as filter  ESCStatus" in seen.screen
            assert "as a column" not in seen.screen
            assert "sort by it" not in seen.screen

    asyncio.run(work())


@pytest.mark.parametrize(
    ("session", "group", "said"), [(1, 2, ""), (2, 2, "there is no shell that could have it go on")]
)
def test_the_whole_job_is_suspended_where_a_shell_can_continue_it(
    session: int, group: int, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    sent: list[tuple[int, int]] = []
    monkeypatch.setattr(os, "getsid", lambda _: session)
    monkeypatch.setattr(os, "getpgrp", lambda: group)
    monkeypatch.setattr(os, "killpg", lambda *told: sent.append(told))

    async def work() -> None:
        async with browser(FAULTS, judged=False) as seen:
            await seen.press("ctrl+z")
            assert sent == ([] if said else [(0, signal.SIGTSTP)])
            assert said in seen.said

    asyncio.run(work())
