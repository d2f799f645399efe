"""Reads MCAP data in tests, from a file or in pieces, and collects everything that came out."""

from __future__ import annotations

from typing import TYPE_CHECKING

import mcaps

from analyzer.sources import Source
from analyzer.sources.mcap import read

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from analyzer._native import Piece


class Got:
    """Everything that a source gave; each record is accounted for."""

    def __init__(self, source: Source, chunks: Iterable[bytes | Piece]) -> None:
        pieces = [piece for piece in chunks if not isinstance(piece, bytes)]
        self.notes = source.notes
        self.frames = [frame for piece in pieces for frame in mcaps.rows_of(piece)]
        self.texts = [text for piece in pieces for text in mcaps.texts_of(piece)]
        self.lines = {key: sum(piece.lines[key] for piece in pieces) for key in pieces[0].lines}
        assert self.lines.pop("lines") == sum(self.lines.values()) - self.lines["dropped_frames"]
        self.damage = str(source.damage).removeprefix(f"{source.name}: ") if source.damage else ""

    @property
    def told(self) -> bool:
        """Whether anything was said to be damaged."""
        return bool(self.damage or self.lines["unreadable"])

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Got) and vars(self) == vars(other)

    __hash__ = None  # type: ignore[assignment]


def from_file(path: Path, data: bytes) -> Got:
    path.write_bytes(data)
    source = Source(str(path))
    return Got(source, source.chunks())


def from_pieces(pieces: Iterable[bytes]) -> Got:
    """As from a pipe."""
    source = Source("-")
    return Got(source, read(source, iter(pieces)))


def cut(data: bytes, size: int) -> list[bytes]:
    return [data[at : at + size] for at in range(0, len(data), size)]
