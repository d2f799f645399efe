"""A drain at one end of a pair of sockets: what the kernel would hand over, and what came of it."""

from __future__ import annotations

import socket
import struct
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from command import LIMIT

from analyzer._native import Piece, Reader

if TYPE_CHECKING:
    from collections.abc import Iterator

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


def columns(piece: Piece, *left_out: str) -> list[dict[str, Any]]:
    return [{name: table[name] for name in table if name not in left_out} for table in piece.columns()]


def read(log: str) -> Piece:
    reader = Reader("candump")
    reader.feed(log.encode())
    reader.finish()
    return reader.take()


def longs(column: bytes) -> list[int]:
    return list(memoryview(column).cast("q"))


def words(column: bytes) -> list[int]:
    return list(memoryview(column).cast("I"))
