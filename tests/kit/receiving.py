"""Receivers for tests: a pair of sockets in place of the kernel, and a clock that goes on when somebody waits."""

from __future__ import annotations

import re
import socket
import struct
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from analyzer._native import FrameBatch, Reader, Writer
from kit.command import LIMIT, START

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer._native import FrameBatch
    from analyzer.live.interfaces.receiver import Receiver

SECOND = 10**9


class Clock:
    """Goes on when somebody waits."""

    def __init__(self) -> None:
        self.seconds = 0.0

    def ns(self) -> int:
        return START + round(self.seconds * SECOND)

    def now(self) -> float:
        return self.seconds

    def sleep(self, seconds: float) -> None:
        assert seconds > 0
        self.seconds += seconds


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


def read(log: str) -> FrameBatch:
    reader = Reader("candump")
    reader.feed(log.encode())
    reader.finish()
    return reader.take()


def longs(column: bytes) -> list[int]:
    return list(memoryview(column).cast("q"))


def words(column: bytes) -> list[int]:
    return list(memoryview(column).cast("I"))
