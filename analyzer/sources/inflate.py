"""Gzip as a stream: what can be unpacked is delivered, and damage has a place."""

from __future__ import annotations

import zlib
from typing import TYPE_CHECKING

from analyzer.sources.errors import UnpackError
from analyzer.sources.unpack import unpack

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

_MAGIC = b"\x1f\x8b"
# Most bytes that one step unpacks: the memory of a gzip bomb.
_STEP = 1 << 20


def inflate(pieces: Iterable[bytes]) -> Iterator[bytes]:
    """Return the text of gzip members that stand one after another, in parts of about 1 MiB; zeros may fill up the end.

    An empty piece (nothing new yet) is passed on. Raises `UnpackError` behind everything that was sound.
    """
    return unpack(pieces, _Stream())


class _Stream:
    """Where in which member the reading stands."""

    def __init__(self) -> None:
        self._member = _member()
        self._members = self._place = 0
        self._between = True

    def feed(self, data: bytes) -> Iterator[bytes]:
        """Unpacks stored bytes, one full step after another."""
        while data := self._unpadded(data):
            saved = self._member.copy()
            try:
                out = self._member.decompress(data, _STEP)
            except zlib.error as error:
                good, count = _salvage(saved, data)
                if self._between and self._members and count < len(_MAGIC):
                    raise UnpackError(self._place, "data behind the end of the gzip data") from None
                yield from good
                raise UnpackError(self._place + count, f"damaged gzip data ({_words(error)})") from None
            self._between = self._member.eof
            left = self._member.unused_data if self._between else self._member.unconsumed_tail
            self._place += len(data) - len(left)
            data = left
            if self._between:
                self._member = _member()
                self._members += 1
            if out:
                yield out

    def end(self) -> Iterator[bytes]:
        """Give what a full step may have left inside the decompressor; an unfinished member is an error."""
        if not self._between:
            while out := self._member.decompress(b"", _STEP):
                yield out
            raise UnpackError(self._place, "gzip data ends early")

    def _unpadded(self, data: bytes) -> bytes:
        if not (self._between and self._members):
            return data
        rest = data.lstrip(b"\0")
        self._place += len(data) - len(rest)
        return rest


def _member() -> zlib._Decompress:
    return zlib.decompressobj(wbits=31)


def _words(error: zlib.error) -> str:
    return str(error).rpartition(": ")[2]


def _salvage(member: zlib._Decompress, data: bytes) -> tuple[list[bytes], int]:
    """Return what a step that failed would have given up to the bad byte, and how many bytes stand in front of that."""
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
