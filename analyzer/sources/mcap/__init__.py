"""MCAP: the frames of all channels whose schema describes a CAN message, read as a stream from front to end."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.sources.mcap.reader import Reader

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer._native import FrameBatch
    from analyzer.sources import Source


def read(source: Source, chunks: Iterator[bytes]) -> Iterator[bytes | FrameBatch]:
    """Batches of rows; a record is a message, or something damaged."""
    reader = Reader(source)
    try:
        for chunk in chunks:
            if not chunk:
                yield b""
                continue
            yield from reader.feed(chunk)
        yield from reader.finish()
    finally:
        source.notes += reader.notes()
