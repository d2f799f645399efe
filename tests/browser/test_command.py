"""`tailbyte view` as a command: what it refuses, and how it says so."""

from __future__ import annotations

import asyncio
import shutil
from typing import TYPE_CHECKING

import pytest
from kit.browsing import browser, capture

from analyzer.cli import main

if TYPE_CHECKING:
    from pathlib import Path


@pytest.mark.parametrize("term", ["dumb", ""])
def test_a_terminal_without_a_cursor_is_told_of_decode(
    term: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("TERM", term)
    assert main(["view", capture("hover.log")]) == 2
    shown = capsys.readouterr()
    assert shown.out == ""
    assert len(shown.err.splitlines()) == 1
    assert "tailbyte decode" in shown.err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("-Y", "ESCStatus.voltag > 1"), "voltage"),
        (("--at", "gestern"), "--at"),
        (("-e", "ESCStatus.nothing"), "nothing"),
        (("-Y", "finding.rules == 3"), "finding.rule"),
    ],
)
def test_wrong_options_are_told_first(
    words: tuple[str, ...], said: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("TERM", "dumb")
    assert main(["view", capture("hover.log"), *words]) == 2
    assert said in capsys.readouterr().err


@pytest.mark.parametrize("content", [b"", b"no capture at all\n" * 20, b"(1.0) can0 1F0"])
def test_empty_and_foreign_captures(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "odd.log"
    path.write_bytes(content)

    async def work() -> None:
        async with browser(path) as seen:
            assert "0 frames" in seen.screen
            assert seen.app.view.supply.notes
            await seen.press("down", "end", "tab", "r", "f", "n", "a", "n", "m", "right_square_bracket", "T")
            assert "holds no frame" in seen.screen

    asyncio.run(work())


def test_a_capture_that_vanishes_stays_on_the_screen(tmp_path: Path) -> None:
    path = tmp_path / "flight.log"
    shutil.copy(capture("hover.log"), path)

    async def work() -> None:
        async with browser(path) as seen:
            path.unlink()
            await seen.press("end")
            await seen.filtered("RawCommand")
            assert len(seen.app.view.rows) > 100

    asyncio.run(work())
