"""Marks of a capture on the way to a copy of it, which may be a part: frames are known by their records."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.tables import wrap
from analyzer.window.cut import RECORDED
from dissectors.kit.cells import numbers

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from analyzer._native import FrameBatch
    from dissectors.kit import Array

_Record = tuple[int, int, int]  # line, time and identifier: an MCAP record may hold several frames


class MarkedFrames:
    """Finds the frames with comments again in what is left of their batches.

    Args:
        comments: by frame, from 0.
    """

    def __init__(self, comments: Mapping[int, str]) -> None:
        self._comments = dict(comments)
        self._places = np.array(sorted(comments), np.int64)
        self._records: dict[_Record, str] = {}
        self._frames = 0

    def over(self, batches: Iterator[FrameBatch]) -> Iterator[FrameBatch]:
        """Yield the batches of the whole capture, and look at them."""
        for batch in batches:
            first, self._frames = self._frames, self._frames + batch.frames
            inside = self._places[(self._places >= first) & (self._places < self._frames)]
            if len(inside):
                for place, record in zip(inside.tolist(), _records(batch, inside - first), strict=True):
                    self._records[record] = self._comments[place]
            yield batch

    def rows(self, batch: FrameBatch) -> dict[int, str] | None:
        """Return the comments on a batch, which may be cut, by its rows; None without any."""
        if not self._records:
            return None
        lines = numbers(wrap(RECORDED, batch.columns()[0]).column("line"))
        near = np.flatnonzero(np.isin(lines, [line for line, _, _ in self._records]))
        found = {
            row: text
            for row, record in zip(near.tolist(), _records(batch, near), strict=True)
            if (text := self._records.get(record)) is not None
        }
        return found or None


def _records(batch: FrameBatch, rows: Array) -> Iterator[_Record]:
    """Yield what tells frames from others."""
    table = wrap(RECORDED, batch.columns()[0])
    line, t, identifier = (numbers(table.column(name))[rows].tolist() for name in ("line", "t", "id"))
    return zip(line, t, identifier, strict=True)
