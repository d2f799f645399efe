"""What a capture holds, or a file beside it, reaches the terminal as text only, whatever shows it."""

from __future__ import annotations

import asyncio
import shutil
from typing import TYPE_CHECKING

import pytest
from kit.browsing import browser, capture
from kit.command import log
from kit.monitor import named

from analyzer.app.browse.session import BrowseOptions
from analyzer.cli import main

if TYPE_CHECKING:
    from pathlib import Path

EVIL = "\x1b[2J\x1b]52;c;aGFjaw==\x07\r\n\u202eevil\x9b31m [bold]x"
KEYS = (
    "right_parenthesis", "M", "escape", "tab", "down", "enter", "escape", "y", "d", "y", "v", "f", "n", "a", "P", "s",
    "escape", "i", "S", "c", "E", "space", "escape", "2", "down", "3", "down", "4", "5", "6", "enter", "7", "1",
)  # fmt: skip


@pytest.fixture(params=["beside", "inside", "names"])
def hostile(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    path = tmp_path / "flight.log"
    if request.param == "names":
        path.write_bytes(log(named(20, EVIL.encode()[:80])))
        return path
    shutil.copy(capture("hover.log"), path)
    marks = "".join(f'[[mark]]\nframe = {frame}\ntext = """{_toml(EVIL)}"""\n' for frame in (5, 40, 300))
    path.with_name("flight.log.marks.toml").write_text(marks)
    if request.param == "beside":
        return path
    copy = tmp_path / "copy.pcapng"
    assert main(["convert", str(path), str(copy)]) == 0
    return copy


def _toml(text: str) -> str:
    return "".join(one if one.isprintable() else f"\\u{ord(one):04x}" for one in text)


def test_nothing_but_text_is_drawn(hostile: Path) -> None:
    async def work() -> None:
        async with browser(hostile, options=BrowseOptions()) as seen:
            for key in KEYS:
                await seen.press(key)
                lines = seen.screen.split("\n")
                assert all(map(str.isprintable, lines)), (key, lines)
                assert len(lines) == 24

    asyncio.run(work())


def test_nothing_but_text_is_typed() -> None:
    async def work() -> None:
        async with browser(capture("hover.log"), judged=False) as seen:
            await seen.press("M")
            seen.app.bar.value = EVIL
            await seen.pilot.pause()
            assert all(map(str.isprintable, seen.screen.split("\n")))

    asyncio.run(work())
