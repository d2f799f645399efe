"""Formats that the native core reads from any cut of their bytes."""

from __future__ import annotations

from itertools import chain
from typing import TYPE_CHECKING, cast

from analyzer._native import Reader

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from analyzer._native import FrameBatch
    from analyzer.sources import Source

# Rows of a batch, at least.
WORTH = 1 << 14
_READERS = {
    "candump text": "candump",
    "pcap": "pcap",
    "pcapng": "pcapng",
    "ArduPilot dataflash": "dataflash",
    "pydronecan log": "dronecan",
}


def read(source: Source, chunks: Iterator[bytes]) -> Iterator[bytes | FrameBatch]:
    """Batches of rows, in the sizes of `gathered`."""
    reader = Reader(_READERS[source.format.name])
    yield from gathered(reader, chunks)
    if reader.damage is not None:
        at, reason = reader.damage
        source.damaged(f"byte {at}{' of the unpacked data' if source.packing else ''}", reason)


def rows(chunks: Iterable[bytes | FrameBatch]) -> Iterator[bytes | FrameBatch]:
    """Return what a source gives as rows throughout: candump text is parsed here; an empty text stays what it is."""
    stream = iter(chunks)
    for chunk in stream:
        if isinstance(chunk, bytes) and chunk:
            # A capture that begins as text is text to its end.
            yield from gathered(Reader("candump"), chain([chunk], cast("Iterator[bytes]", stream)))
            return
        yield chunk


def frame_batches(chunks: Iterable[bytes | FrameBatch]) -> Iterator[FrameBatch]:
    """Return only the rows of what a source gives."""
    return (batch for batch in rows(chunks) if not isinstance(batch, bytes))


def gathered(reader: Reader, chunks: Iterator[bytes]) -> Iterator[bytes | FrameBatch]:
    """Feed the reader; a pipe gives little at a time, so rows wait until a batch is worth handing over.

    An empty chunk says that nothing new has come yet: then nothing waits any longer.
    """
    for chunk in chunks:
        if chunk:
            reader.feed(chunk)
        if reader.waiting >= WORTH or (reader.waiting and not chunk):
            yield reader.take()
        if not chunk:
            yield b""
        if reader.damage is not None:
            break
    reader.finish()
    yield reader.take()
