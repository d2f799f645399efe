"""What has little room: frames of CAN FD, and rules beside what rows say."""

from __future__ import annotations

import asyncio
import shutil
from typing import TYPE_CHECKING

import pytest
from kit.browsing import browser, capture
from textual.events import MouseDown

from analyzer.app.browse.session import BrowseOptions

if TYPE_CHECKING:
    from pathlib import Path

    from kit.browsing import Seen

LENGTH = 64


@pytest.fixture
def long_frame(tmp_path: Path) -> Path:
    """Return a capture of one frame with 64 bytes, each of them its own place."""
    path = tmp_path / "fd.log"
    path.write_text(f"(1773475330.000000) can0 1F040A0B##0{bytes(range(LENGTH)).hex()}\n")
    return path


@pytest.mark.parametrize("size", [(60, 20), (80, 24), (120, 30)])
def test_every_byte_of_a_long_frame_can_be_seen_and_clicked(size: tuple[int, int], long_frame: Path) -> None:
    async def work() -> None:
        async with browser(long_frame, size) as seen:
            await seen.press("tab", "tab")
            pane = seen.app.bytes
            for wanted in range(LENGTH):
                pane.to((0, wanted))
                await seen.pilot.pause()
                y, x = _cell(seen, f"{wanted:02X}")
                assert pane.text.splitlines()[y][x:] != ""
                pane.at = (0, 0)
                _click(seen, x, y)
                assert pane.at == (0, wanted)

    asyncio.run(work())


def _cell(seen: Seen, digits: str) -> tuple[int, int]:
    """Return line and column of a byte that stands on the screen."""
    for y, strip in enumerate(map(seen.app.bytes.render_line, range(1, seen.app.bytes.size.height)), 1):
        at = strip.text.find(digits, 23)
        if at >= 0:
            return y, at
    raise AssertionError(seen.screen)


def _click(seen: Seen, x: int, y: int) -> None:
    pane = seen.app.bytes
    pane.on_mouse_down(
        MouseDown(pane, x=x, y=y, delta_x=0, delta_y=0, button=1, shift=False, meta=False, ctrl=False)
    )  # fmt: skip


def test_lines_of_bytes_are_broken_anew_for_another_size(long_frame: Path) -> None:
    async def work() -> None:
        async with browser(long_frame, (120, 24)) as seen:
            await seen.press("tab", "tab")
            seen.app.bytes.to((0, LENGTH - 1))
            for size in ((60, 20), (120, 24)):
                await seen.pilot.resize_terminal(*size)
                await seen.until(lambda: f"{LENGTH - 1:02X}  " in seen.screen and "3E" in seen.screen)

    asyncio.run(work())


@pytest.mark.parametrize(
    ("width", "head", "row"),
    [(80, "Info                       Rule", "ch1 50.1V 0.1A 20C 0r…  TYP-301"), (60, "Info", "ch1 50.1V…")],
)
def test_rules_leave_room_for_what_a_row_says(width: int, head: str, row: str) -> None:
    async def work() -> None:
        async with browser(capture("mission-8-faults.log"), (width, 20)) as seen:
            lines = seen.screen.splitlines()
            assert lines[3].endswith(head)
            assert lines[4].endswith(row)

    asyncio.run(work())


def test_a_line_in_full_is_full_with_wide_letters(tmp_path: Path) -> None:
    path = tmp_path / "flight.log"
    shutil.copy(capture("hover.log"), path)
    text = "過熱する電池" * 20
    path.with_name("flight.log.marks.toml").write_text(f'[[mark]]\nframe = 1\ntext = "{text}"\n')

    async def work() -> None:
        async with browser(path, options=BrowseOptions(), judged=False) as seen:
            await seen.press("tab", "home", "enter")
            await seen.until(lambda: "The line in full" in seen.screen)
            assert text in "".join(line.strip() for line in seen.screen.splitlines())

    asyncio.run(work())
