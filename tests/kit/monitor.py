"""Sessions for tests of the board and the monitor, and the monitor without a terminal."""

from __future__ import annotations

import asyncio
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from functools import cache
from typing import TYPE_CHECKING, Any

from analyzer.board.board import Board
from analyzer.board.snapshot import RecordingState
from analyzer.decode.engine import Engine
from analyzer.terminal.app import Monitor
from kit import encode
from kit.command import CAPTURES, START
from kit.flight import node_info
from kit.judged import registry
from kit.reports import change

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Awaitable, Callable, Iterable, Iterator

    from textual.pilot import Pilot
    from textual.strip import Strip

    from analyzer.board.snapshot import Snapshot
    from analyzer.decode.engine import Batch
    from analyzer.report.model import Severity
    from analyzer.report.newest import Change

STATUS, INFO = "uavcan.protocol.NodeStatus", "uavcan.protocol.GetNodeInfo.Response"
LINES = 800  # of candump text in a batch, as many as a full bus brings in 0.1 s


def trouble(
    rule: str,
    severity: Severity = "error",
    *,
    node: int | None = 22,
    text: str = "is wrong",
    t: int = START,
    **more: Any,
) -> Change:
    """A finding as the session tells the board; its title is "something"."""
    given = {"title": "something", "type": "NodeStatus"} | more
    return change(rule, severity, t, node=node, text=text, **given)


def capture(name: str) -> bytes:
    return (CAPTURES / name).read_bytes()


def status(node: int, k: int, t: int, bus: str = "can0", **fields: int) -> list[encode.Frame]:
    """The NodeStatus number `k`."""
    said = {"uptime_sec": k, "health": 0, "mode": 0, "sub_mode": 0, "vendor_specific_status_code": 0} | fields
    return encode.transfer(STATUS, said, node, k).frames(t, bus=bus)


def named(node: int, name: bytes, t: int = START) -> list[encode.Frame]:
    """The answer of a node that somebody asked for its name."""
    return encode.transfer(INFO, node_info(0, 0) | {"name": list(name)}, node, 0, dst=1).frames(t)


def esc(node: int, k: int, t: int, **fields: float) -> list[encode.Frame]:
    """The status number `k` of an ESC."""
    said = {"error_count": 0, "voltage": 40.0, "current": 1.0, "temperature": 30.0, "rpm": 1, "power_rating_pct": 0}
    return encode.transfer("ESCStatus", {**said, "esc_index": 0, **fields}, node, k).frames(t)


def text_of(frames: Iterable[encode.Frame]) -> bytes:
    return "".join(encode.log_line(frame, 9) + "\n" for frame in frames).encode()


def batches(text: bytes, step: int = LINES) -> Iterator[Batch]:
    """The text in batches of so many lines; nothing is closed at the end, as in a session that goes on."""
    engine, rows = Engine(registry()), text.splitlines(keepends=True)
    for start in range(0, len(rows), step):
        yield from engine.feed(b"".join(rows[start : start + step]))
        yield engine.flush()


def board_of(text: bytes, step: int = LINES, **settings: object) -> tuple[Board, int]:
    """A board that has seen a text, and the time of its last frame; batches come as soon as they can."""
    board, now = Board(registry(), {"can0": None}, **settings), 0  # type: ignore[arg-type]
    for batch in batches(text, step):
        if len(batch.frames):
            now = batch.frames.column("t")[-1].value
        board.feed(batch, now)
    return board, now


def shown(text: bytes, step: int = LINES, after: int = 0) -> Snapshot:
    """The snapshot so many nanoseconds after the last frame of a text."""
    board, now = board_of(text, step)
    return board.snapshot(now + after)


@dataclass
class Script:
    """A feed that gives one snapshot after the other, the last one for ever, and notes what it is asked for."""

    states: list[Snapshot | None]
    asked: list[str] = field(default_factory=list)
    ended: bool = False
    looks: int = 0

    def snapshot(self) -> Snapshot | None:
        self.looks += 1
        return self.states.pop(0) if len(self.states) > 1 else self.states[0]

    def mark(self) -> str:
        self.asked.append("mark")
        return "mark 1"

    def clear(self) -> str:
        self.asked.append("clear")
        return ""

    def save(self) -> str:
        self.asked.append("save")
        return "saved as report.html"

    def browse(self) -> str:
        self.asked.append("browse")
        return ""

    def stop(self) -> None:
        self.asked.append("stop")


SMALL, WIDE = (80, 24), (200, 50)
LOOKS = 200  # of the feed, or turns of the loop; only ever reached when something hangs


@cache
def session(name: str) -> Snapshot:
    board, now = board_of(capture(name))
    board.take_recording(RecordingState("flights/a.mcap", 12_345_678, 4242))
    found = [trouble("TRF-010", node=13, text="wrong CRC", t=now), trouble("TYP-305", "warning", node=14, t=now)]
    board.take_findings(found, now)
    return board.snapshot(now)


def seen(app: Monitor) -> list[str]:
    """The lines of the terminal."""
    strips: list[Strip] = app.screen._compositor.render_strips()
    return [strip.text for strip in strips]


def text(app: Monitor) -> str:
    return "\n".join(seen(app))


@asynccontextmanager
async def opened(feed: Script, size: tuple[int, int] = SMALL) -> AsyncIterator[tuple[Monitor, Pilot[None]]]:
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
        async with opened(feed, size) as (app, pilot):
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
