"""Where frames that were picked from a capture stand in it, for who numbers only what was picked."""

from __future__ import annotations

from bisect import bisect_right
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from dissectors.kit import Array

_ALL = np.zeros(0, np.uint8)


class Places:
    """The places in the capture, from 0, of picked frames, which are numbered from 0 without gaps.

    It takes a bit for each frame that was passed.
    """

    def __init__(self) -> None:
        self._begins: list[int] = []  # the first picked frame of each part
        self._firsts: list[int] = []  # the place of the part's first frame, or of the first one that was picked
        self._bits: list[Array] = []  # which of the part were picked; empty if they follow each other
        self._count = 0
        self._opened: tuple[int, Array] = -1, _ALL

    def add(self, first: int, rows: Array) -> None:
        """Take rows, in order, that were picked from the next part of the capture, whose first frame is at `first`."""
        if not len(rows):
            return
        low, high = int(rows[0]), int(rows[-1])
        self._begins.append(self._count)
        self._firsts.append(first + low)
        self._count += len(rows)
        if high - low + 1 == len(rows):
            self._bits.append(_ALL)
            return
        mask = np.zeros(high - low + 1, bool)
        mask[rows.astype(np.int64) - low] = True
        self._bits.append(np.packbits(mask))

    def of(self, frame: int) -> int:
        """Return the place of a picked frame; what is none, such as -1, stays as it is."""
        if not 0 <= frame < self._count:
            return frame
        part = bisect_right(self._begins, frame) - 1
        row = frame - self._begins[part]
        if not len(self._bits[part]):
            return self._firsts[part] + row
        if self._opened[0] != part:
            self._opened = part, np.flatnonzero(np.unpackbits(self._bits[part]))
        return self._firsts[part] + int(self._opened[1][row])
