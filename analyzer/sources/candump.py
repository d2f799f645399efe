"""Candump text goes to the engine as it is: parsing it is the core's first step."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.sources.formats import UTF8_MARK

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.sources import Source


def read(_: Source, chunks: Iterator[bytes]) -> Iterator[bytes]:
    """The text without a byte order mark."""
    head = next(chunks, b"")
    if text := head.removeprefix(UTF8_MARK):
        yield text
    yield from chunks
