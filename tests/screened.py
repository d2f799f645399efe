"""The monitor without a terminal: what is seen of a state, and what somebody does with keys."""

from __future__ import annotations

import asyncio
from contextlib import asynccontextmanager
from functools import cache
from typing import TYPE_CHECKING

from monitored import News, Script, board_of, capture

from analyzer.board.snapshot import Recording
from analyzer.terminal.app import Monitor

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Awaitable, Callable

    from textual.pilot import Pilot
    from textual.strip import Strip

    from analyzer.board.snapshot import Snapshot

SMALL, WIDE = (80, 24), (200, 50)
SECOND = 1_000_000_000
LOOKS = 200  # of the feed, or turns of the loop; only ever reached when something hangs


@cache
def session(name: str) -> Snapshot:
    board, now = board_of(capture(name))
    board.recording(Recording("flights/a.mcap", 12_345_678, 4242))
    board.findings([News("TRF-010", node=13, text="wrong CRC", t=now), News("TYP-305", "warning", node=14, t=now)])
    return board.snapshot(now)


def seen(app: Monitor) -> list[str]:
    """The lines of the terminal."""
    strips: list[Strip] = app.screen._compositor.render_strips()
    return [strip.text for strip in strips]


def text(app: Monitor) -> str:
    return "\n".join(seen(app))


@asynccontextmanager
async def shown(feed: Script, size: tuple[int, int] = SMALL) -> AsyncIterator[tuple[Monitor, Pilot[None]]]:
    app = Monitor(feed)
    async with app.run_test(size=size) as pilot:
        await until(pilot, lambda: feed.looks > 1 or feed.ended)
        await pilot.pause()
        yield app, pilot


async def until(pilot: Pilot[None], true: Callable[[], bool]) -> None:
    for _ in range(LOOKS):
        if true():
            return
        await pilot.pause(0.02)
    raise AssertionError("waited in vain")


def use(feed: Script, does: Callable[[Monitor, Pilot[None]], Awaitable[None]], size: tuple[int, int] = SMALL) -> None:
    """What somebody does with the monitor."""

    async def run() -> None:
        async with shown(feed, size) as (app, pilot):
            await does(app, pilot)

    asyncio.run(run())


def look(state: Snapshot | None, size: tuple[int, int] = SMALL, *keys: str) -> list[str]:
    """The lines after some keys."""
    found: list[str] = []

    async def does(app: Monitor, pilot: Pilot[None]) -> None:
        await pilot.press(*keys)
        await pilot.pause()
        found.extend(seen(app))

    use(Script([state]), does, size)
    return found


def of_device(lines: list[str], label: str) -> list[str]:
    """The words of the row of a device."""
    start = next(k for k, line in enumerate(lines) if line.startswith(("ESC", "unit")))
    return next(line.split() for line in lines[start + 1 :] if line.split()[:1] == [label])
