"""Candump text goes to the engine as it is: parsing it is the core's first step."""

from __future__ import annotations

from itertools import chain
from typing import TYPE_CHECKING

from analyzer.sources.formats import UTF8_MARK

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.sources import Source


def read(source: Source, chunks: Iterator[bytes]) -> Iterator[bytes]:
    """The text without a byte order mark; up to the last whole line if the reading was stopped before the end."""
    last = b""
    for chunk in chain(filter(None, [next(chunks, b"").removeprefix(UTF8_MARK)]), chunks):
        if source.live:
            yield chunk
            continue
        if last:
            yield last
        last = chunk
    if source.stopped and source.size < (source.length or 0):
        last = last[: last.rfind(b"\n") + 1]
    if last:
        yield last
