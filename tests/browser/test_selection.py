"""Rows that are selected: what of them is copied and written."""

from __future__ import annotations

import asyncio
import json
from typing import TYPE_CHECKING

import pytest
from kit.browsing import browser, capture

from analyzer.app.browse.session import BrowseOptions

if TYPE_CHECKING:
    from pathlib import Path

FAULTS = capture("mission-8-faults.log")


def test_rows_are_selected_copied_and_written() -> None:
    async def work() -> None:
        async with browser(FAULTS, judged=False) as seen:
            app = seen.app
            await seen.press("down", "v", "down", "down")
            assert "3 selected" in seen.screen
            assert app.copied("filter") == "frame.number in {4, 9, 12}"
            assert [json.loads(line)["frames"] for line in app.copied("JSON").splitlines()][:2] == [
                [4, 5, 6, 7, 8],
                [9, 10, 11],
            ]
            assert [line.split()[0] for line in app.copied("text").splitlines()] == ["4", "9", "12"]
            assert len(app.copied("candump").splitlines()) == 13
            written: list[tuple[str, str]] = []
            app.tools.write = lambda path, text: written.append((path, text)) or "writing"
            await seen.press("w")
            assert "3 selected rows" in seen.said
            await seen.type("part.log")
            assert written == [("part.log", "frame.number in {4, 9, 12}")]
            await seen.press("escape", "shift+up")
            assert "2 selected" in seen.screen
            await seen.press("v")
            assert "2 selected" not in seen.screen

    asyncio.run(work())


@pytest.mark.slow
def test_what_is_selected_is_written_by_another_process(tmp_path: Path) -> None:
    async def work() -> None:
        async with browser(FAULTS, judged=False) as seen:
            await seen.press("down", "v", "down", "down", "w")
            await seen.type(str(tmp_path / "part.log"))
            await seen.until(lambda: bool(seen.app.tools.said) or "written" in seen.said)
            await seen.press("escape", "w")
            await seen.type(str(tmp_path / "all.csv"))
            await seen.until((tmp_path / "all.csv").exists)

    asyncio.run(work())
    assert len((tmp_path / "part.log").read_text().splitlines()) == 13
    assert len((tmp_path / "all.csv").read_text().splitlines()) == 1 + 3222


def test_a_filter_by_findings_waits_for_them() -> None:
    async def work() -> None:
        options = BrowseOptions(marks=False, filter='finding.rule == "TRF-003" && node == 12')
        async with browser(FAULTS, options=options, judged=False) as seen:
            app = seen.app
            assert app.awaited or app.view.filter
            await seen.until(lambda: not app.view.supply.doing)
            app.look()
            await seen.until(lambda: getattr(app.view.rows, "done", False))
            assert app.view.filter == options.filter
            assert not app.awaited
            assert len(app.view.rows) == 1

    asyncio.run(work())


def test_what_is_said_of_a_filter_that_waits_goes_with_the_wait() -> None:
    async def work() -> None:
        text = 'finding.rule == "TRF-003"'
        async with browser(FAULTS) as seen:
            app, waits = seen.app, [True]
            app.view.waits = lambda _: waits[0]
            await seen.press("equals_sign")
            await seen.type(text)
            assert "once the capture is judged" in seen.said
            assert (app.awaited, app.view.filter) == (text, "")
            waits[0] = False
            app.look()
            assert (app.awaited, app.view.filter) == ("", text)
            assert "once the capture is judged" not in seen.said

    asyncio.run(work())
