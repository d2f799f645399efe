"""Sessions for tests of the board and the monitor: captures and flights in batches, and feeds that follow a script."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import encode
from command import CAPTURES, START
from flight import node_info
from witness.flights import registry

from analyzer.board.board import Board
from analyzer.engine import Engine
from analyzer.simulate import Settings, Simulation
from analyzer.simulate.faults import catalogue
from analyzer.simulate.text import line
from dissectors.traffic import SECOND

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from analyzer.board.snapshot import Snapshot
    from analyzer.engine import Batch

STATUS, INFO = "uavcan.protocol.NodeStatus", "uavcan.protocol.GetNodeInfo.Response"
LINES = 800  # of candump text in a batch, as many as a full bus brings in 0.1 s


class News(NamedTuple):
    """What a rule found, as the session tells the board."""

    rule: str
    severity: str = "error"
    category: str = "protocol"
    bus: int = 0
    node: int = 22
    type: str = "NodeStatus"
    text: str = "something is wrong"
    t: int = START
    frame: int = 0
    count: int = 1
    fresh: bool = True


def capture(name: str) -> bytes:
    return (CAPTURES / name).read_bytes()


def flown(*orders: str, seconds: float = 4.0, escs: int = 4, **settings: object) -> bytes:
    """A simulated flight as candump text."""
    wanted = tuple(catalogue.order(text) for text in orders)
    asked = Settings(escs=escs, duration=round(seconds * SECOND), orders=wanted, **settings)  # type: ignore[arg-type]
    run = Simulation(asked, registry())
    return "".join(line(frame, run.settings.start, ("can0", "can1")) for frame in run.frames()).encode()


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
        board.add(batch, now)
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

    def stop(self) -> None:
        self.asked.append("stop")
