"""Formats that the native core reads from any cut of their bytes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer._native import Reader

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from analyzer._native import Piece
    from analyzer.sources import Source

_READERS = {
    "candump text": "candump",
    "pcap": "pcap",
    "pcapng": "pcapng",
    "ArduPilot dataflash": "dataflash",
    "pydronecan log": "dronecan",
}


def read(source: Source, chunks: Iterator[bytes]) -> Iterator[bytes | Piece]:
    """A piece of rows for each chunk."""
    reader = Reader(_READERS[source.format.name])
    for chunk in chunks:
        if not chunk:
            yield b""
            continue
        reader.feed(chunk)
        yield reader.take()
        if reader.damage is not None:
            break
    reader.finish()
    yield reader.take()
    if reader.damage is not None:
        at, reason = reader.damage
        source.damaged(f"byte {at}{' of the unpacked data' if source.packing else ''}", reason)


def rows(chunks: Iterable[bytes | Piece]) -> Iterator[bytes | Piece]:
    """What a source gives as rows throughout: candump text is parsed here; an empty text stays what it is."""
    text: Reader | None = None
    for chunk in chunks:
        if not isinstance(chunk, bytes) or not chunk:
            yield chunk
            continue
        text = text or Reader("candump")
        text.feed(chunk)
        yield text.take()
    if text is not None:
        text.finish()
        yield text.take()
