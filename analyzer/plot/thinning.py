"""Fewer points without losing a peak: the lowest and the highest of every so many, in bounded memory.

Buckets are 2^k points in a row, k as small as the limit allows for all points there were, so that the result does not
depend on how the points came in. A bucket gives its lowest and highest point where they are; what is no number counts
only in a bucket without numbers.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from analyzer.plot.moments import Moments

if TYPE_CHECKING:
    from dissectors.kit import Array

_PIECE = 1024


def _none(kind: type) -> Array:
    return np.zeros(0, kind)


@dataclass(slots=True)
class Thinned:
    """One series of at most `most` points (4 at least); while it grows it holds twice as many and `_PIECE` more."""

    most: int
    count: int = 0
    _place: Array = field(default_factory=lambda: _none(np.int64))
    _t: Array = field(default_factory=lambda: _none(np.int64))
    _frame: Array = field(default_factory=lambda: _none(np.int64))
    _values: Array = field(default_factory=lambda: _none(np.float64))

    def feed(self, moments: Moments, values: Array) -> None:
        """Take the next points."""
        for start in range(0, len(values), _PIECE):
            self._append(moments[start : start + _PIECE], values[start : start + _PIECE])

    def _append(self, moments: Moments, values: Array) -> None:
        place = np.arange(self.count, self.count + len(values), dtype=np.int64)
        self._place = np.concatenate((self._place, place))
        self._t = np.concatenate((self._t, moments.t))
        self._frame = np.concatenate((self._frame, moments.frame))
        self._values = np.concatenate((self._values, values))
        self.count += len(values)
        if len(self._place) > 2 * self.most:
            self._compact()

    @property
    def bucket(self) -> int:
        """Points that become two; 1 when none are left out."""
        size = 1
        while self.count > self.most and 2 * -(-self.count // size) > self.most:
            size *= 2
        return size

    def _compact(self) -> None:
        size = self.bucket
        if size == 1:
            return
        bucket = self._place // size
        starts = np.concatenate(([0], np.flatnonzero(np.diff(bucket)) + 1))
        of = np.cumsum(np.diff(bucket, prepend=bucket[0]) != 0)
        missing = np.isnan(self._values)
        kept = np.zeros(len(bucket), bool)
        for sign in (1.0, -1.0):
            keys = np.where(missing, np.inf, sign * self._values)
            hits = np.flatnonzero(keys == np.minimum.reduceat(keys, starts)[of])
            kept[hits[np.concatenate(([True], np.diff(of[hits]) != 0))]] = True
        self._place, self._t = self._place[kept], self._t[kept]
        self._frame, self._values = self._frame[kept], self._values[kept]

    def points(self) -> tuple[Moments, Array]:
        """Return what is left, in order."""
        self._compact()
        return Moments(self._t, self._frame), self._values
