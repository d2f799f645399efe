"""Candump text goes to the engine as it is: parsing it is the core's first step."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.sources import Source


def read(_: Source, chunks: Iterator[bytes]) -> Iterator[bytes]:
    """Return the text."""
    return chunks
