"""Compressed data as a stream, whatever the compression."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator


class CompressedPlace(Protocol):
    """Where in the compressed data the reading stands."""

    def feed(self, data: bytes) -> Iterator[bytes]:
        """Unpack the next stored bytes, in bounded steps. Raises `UnpackError` behind everything that was sound."""

    def end(self) -> Iterator[bytes]:
        """Return what is left at the end. Raises `UnpackError` if the data ends too early."""


def unpack(pieces: Iterable[bytes], stream: CompressedPlace) -> Iterator[bytes]:
    """Return the unpacked pieces; an empty one (nothing new yet) is passed on. Raises `UnpackError`."""
    for piece in pieces:
        if piece:
            yield from stream.feed(piece)
        else:
            yield b""
    yield from stream.end()
