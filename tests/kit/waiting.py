"""What waits, without waiting: receivers at a pair of sockets, captures to be replayed, a clock."""

from __future__ import annotations

import os
import re
import socket
import struct
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from analyzer._native import FrameBatch, Writer
from analyzer.cli.replay import playing as replay_run
from analyzer.sinks import open_sink
from kit.command import LIMIT, START
from kit.rows import EXTENDED, Fault, Frame, piece

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import pytest

    from analyzer.live.interfaces.receiver import Receiver

SECOND, MS = 10**9, 10**6


class Clock:
    """Time passes only in its sleeps, each of which may be a little too long, and when it is told to; in ns."""

    def __init__(self, over: int = 0, start: int = START) -> None:
        self.passed, self.over, self.start = 0, over, start
        self.slept: list[float] = []

    def __call__(self) -> int:
        return self.passed

    def ns(self) -> int:
        """Of the wall."""
        return self.start + self.passed

    @property
    def seconds(self) -> float:
        return self.passed / SECOND

    @seconds.setter
    def seconds(self, value: float) -> None:
        self.passed = round(value * SECOND)

    def now(self) -> float:
        return self.seconds

    def sleep(self, seconds: float) -> None:
        assert seconds > 0
        self.slept.append(seconds)
        self.passed += max(1, round(seconds * SECOND)) + self.over


def text(piece: FrameBatch | None) -> list[str]:
    """Its rows as lines, with times in seconds from the start of the test; remarks and drops without theirs."""
    assert piece is not None
    found = Writer("candump").write(piece).decode()
    found = re.sub(r"^(# )\(\S+\) |^(DROPCOUNT.*\)) \(\S+\)$", r"\1\2", found, flags=re.MULTILINE)
    return re.sub(r"\((\d+)\.", lambda stamp: f"({int(stamp[1]) - START // SECOND:02}.", found).splitlines()


def everything(receiver: Receiver, clock: Clock, seconds: float = 1.0) -> list[str]:
    """What it gives in this time, which passes when there is nothing."""
    found: list[str] = []
    end = clock.seconds + seconds
    while clock.seconds < end:
        piece = receiver.receive(0.01)
        if piece is None:
            clock.seconds += 0.01
        else:
            found += text(piece)
    return found


FOREVER = 10 * LIMIT * 1000  # ms, longer than any test waits
ROOM = 8 << 20
Pair = tuple[socket.socket, socket.socket]


def classic(word: int, data: bytes = b"", length: int | None = None, code: int = 0) -> bytes:
    return struct.pack("=IBxxB8s", word, len(data) if length is None else length, code, data)


def fd(word: int, flags: int, data: bytes) -> bytes:
    return struct.pack("=IBBxx64s", word, len(data), flags, data)


@contextmanager
def local_pair() -> Iterator[Pair]:
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    theirs.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, ROOM)
    with ours, theirs:
        yield ours, theirs


@contextmanager
def lossy_pair() -> Iterator[Pair]:
    """A connection that drops what its small receive buffer does not hold."""
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ours,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as theirs,
    ):
        ours.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 8192)
        for end in ours, theirs:
            end.bind(("127.0.0.1", 0))
        ours.connect(theirs.getsockname())
        theirs.connect(ours.getsockname())
        yield ours, theirs


def columns(piece: FrameBatch, *left_out: str) -> list[dict[str, Any]]:
    return [{name: table[name] for name in table if name not in left_out} for table in piece.columns()]


def longs(column: bytes) -> list[int]:
    return list(memoryview(column).cast("q"))


def words(column: bytes) -> list[int]:
    return list(memoryview(column).cast("I"))


STATUS, RAW = 0x1F040A0B, 0x0A040601


def replays_wait_by(clock: Clock, monkeypatch: pytest.MonkeyPatch) -> Clock:
    monkeypatch.setattr(replay_run, "Pacer", partial(replay_run.Pacer, clock=clock, sleep=clock.sleep))
    return clock


def frames(*ids: int, step: int = MS, bus: str = "can0", flags: int = EXTENDED) -> list[Frame]:
    return [Frame(START + k * step, bus, number, flags, bytes([k & 0xFF, 0xC0])) for k, number in enumerate(ids)]


def log(path: str, found: Sequence[Frame | Fault]) -> str:
    with Path(path).open("wb") as file:
        sink = open_sink("candump", file)
        sink.write(piece(found))
        sink.close()
    return path


@contextmanager
def standard_input() -> Iterator[BinaryIO]:
    """Another end for it."""
    end, begin = os.pipe()
    before = os.dup(0)
    os.dup2(end, 0)
    os.close(end)
    try:
        with os.fdopen(begin, "wb", buffering=0) as pipe:
            yield pipe
    finally:
        os.dup2(before, 0)
        os.close(before)
