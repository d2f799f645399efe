"""Gzip as a stream: what can be unpacked is delivered, and damage has a place."""

from __future__ import annotations

import zlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

MAGIC = b"\x1f\x8b"
# Most bytes that one step unpacks: the memory of a gzip bomb.
_STEP = 1 << 20


class GzipError(Exception):
    """Damage: the number of stored bytes in front of it, and what it is."""

    def __init__(self, place: int, reason: str) -> None:
        super().__init__(reason)
        self.place, self.reason = place, reason


def inflate(pieces: Iterable[bytes]) -> Iterator[bytes]:
    """The text of gzip members that stand one after another, in pieces of at most 1 MiB; zeros may fill up the end.

    An empty piece (nothing new yet) is passed on. Raises `GzipError` behind everything that was sound.
    """
    member, place, members = _member(), 0, 0
    between = True
    for piece in pieces:
        rest = piece
        if not piece:
            yield b""
        while rest:
            if between and members:
                place, rest = place + len(rest), rest.lstrip(b"\0")
                place -= len(rest)
                if not rest:
                    break
            saved = member.copy()
            try:
                out = member.decompress(rest, _STEP)
            except zlib.error as error:
                good, count = _salvage(saved, rest)
                yield from good
                if between and members:
                    raise GzipError(place, "data behind the end of the gzip data") from None
                raise GzipError(place + count, _words(error)) from None
            left = member.unused_data if member.eof else member.unconsumed_tail
            place, rest, between = place + len(rest) - len(left), left, member.eof
            if out:
                yield out
            if member.eof:
                member, members = _member(), members + 1
    if not between:
        # A step that was full may have left text inside the decompressor.
        while out := member.decompress(b"", _STEP):
            yield out
        raise GzipError(place, "gzip data ends early")


def _member() -> zlib._Decompress:
    return zlib.decompressobj(wbits=31)


def _words(error: zlib.error) -> str:
    return f"damaged gzip data ({str(error).rpartition(': ')[2]})"


def _salvage(member: zlib._Decompress, data: bytes) -> tuple[list[bytes], int]:
    """What a step that failed would have given up to the bad byte, and how many bytes stand in front of that."""
    good, at, size = list[bytes](), 0, max(1, len(data) // 2)
    while True:
        attempt = member.copy()
        try:
            good.append(attempt.decompress(data[at : at + size]))
        except zlib.error:
            if size == 1:
                return good, at
        else:
            member, at = attempt, at + size
        size = max(1, size // 2)
