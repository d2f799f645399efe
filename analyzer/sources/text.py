"""Captures that are text: what stands in front of the first line, and where the last one ends."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.sources.formats import UTF8_MARK

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from analyzer.sources.stored import Stored

# Longer than any line that is read.
_LONGEST = 1 << 16


def text_of(source: Stored, chunks: Iterator[bytes], cut: Callable[[int], None]) -> Iterator[bytes]:
    """Return the text without a byte order mark; an empty chunk goes on as it is.

    Of a text that ends in the middle of a line `cut` is told the size. If the reading was ended on purpose, nothing is
    known of the rest of that line: then it is left out.
    """
    held, size = b"", 0
    for chunk in chunks:
        part, whole = chunk if size else chunk.removeprefix(UTF8_MARK), b""
        size += len(chunk)
        if not chunk and size:
            yield b""
        elif source.live:
            whole, held = _split(held + part)
        else:  # what is large is not copied
            whole, held = held, part
        if chunk and whole:
            yield whole
        del chunk, part, whole  # else they would be there while the next one is read
    whole, rest = _split(held)
    if source.stopped:
        held = whole
    elif rest:
        cut(size)
    if held:
        yield held


def _split(piece: bytes) -> tuple[bytes, bytes]:
    """Return the whole lines and what there is of the next one, unless that is too long to wait for its end."""
    end = piece.rfind(b"\n") + 1
    return (piece, b"") if len(piece) - end > _LONGEST else (piece[:end], piece[end:])
