"""Fewer points without losing a peak: the lowest and the highest of every so many, in bounded memory.

Buckets are 2^k points in a row, k as small as the limit allows for all points there were, so that the result does not
depend on how the points came in. A bucket gives its lowest and highest point where they are; what is no number counts
only in a bucket without numbers.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.plot.moments import Moments
from dissectors.records import dataclass, field

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dissectors.kit import Array

_PIECE = 1 << 14  # points that are taken at once: they wait as they are until they are thinned


@dataclass(frozen=True, slots=True)
class Thinning:
    """How many points a series had, how many in a row became two, and how many are left."""

    count: int
    bucket: int
    left: int


@dataclass(slots=True)
class _Points:
    """Points that are kept, each with its place in the series."""

    place: Array
    moments: Moments
    values: Array

    def __len__(self) -> int:
        return len(self.place)

    def __getitem__(self, rows: Array) -> _Points:
        return _Points(self.place[rows], self.moments[rows], self.values[rows])


_NONE = _Points(np.zeros(0, np.int64), Moments(np.zeros(0, np.int64), np.zeros(0, np.int64)), np.zeros(0))


@dataclass(slots=True)
class Thinned:
    """One series of at most `most` points (4 at least); while it grows it holds twice as many and `_PIECE` more."""

    most: int
    count: int = 0
    _kept: list[_Points] = field(default_factory=lambda: [_NONE])
    _held: int = 0

    def feed(self, moments: Moments, values: Array) -> None:
        """Take the next points."""
        for start in range(0, len(values), _PIECE):
            self._append(moments[start : start + _PIECE], values[start : start + _PIECE])

    def _append(self, moments: Moments, values: Array) -> None:
        """Thin what fills buckets of today's size; the ends, which are parts of buckets, wait as they are."""
        size, first = self.bucket, self.count
        self.count += len(values)
        head = min(-first % size, len(values))
        body = (len(values) - head) // size * size
        if size > 1 and body:
            ends = np.arange(len(values))
            rows = np.concatenate(
                (ends[:head], head + _outermost(values[head : head + body], size), ends[head + body :])
            )
            moments, values = moments[rows], values[rows]
        else:
            rows = np.arange(len(values))
        self._kept.append(_Points(first + rows, moments, values))
        self._held += len(rows)
        if self._held > 2 * self.most:
            self._compact()

    @property
    def bucket(self) -> int:
        """Points that become two; 1 when none are left out."""
        size = 1
        while self.count > self.most and 2 * -(-self.count // size) > self.most:
            size *= 2
        return size

    def _compact(self) -> None:
        whole = _joined(self._kept)
        if self.bucket > 1:
            whole = whole[_lowest_and_highest(whole.values, whole.place // self.bucket)]
        self._kept, self._held = [whole], len(whole)

    @property
    def thinning(self) -> Thinning:
        """The outcome for the series."""
        return Thinning(self.count, self.bucket, self._held)

    def points(self) -> tuple[Moments, Array]:
        """Return what is left, in order."""
        self._compact()
        return self._kept[0].moments, self._kept[0].values


def _outermost(values: Array, size: int) -> Array:
    """Return the rows of the lowest and the highest number in each whole bucket, in order; one row if it is both."""
    if np.isnan(values).any():
        return _lowest_and_highest(values, np.arange(len(values)) // size)
    buckets = values.reshape(-1, size)
    both = np.stack((buckets.argmin(axis=1), buckets.argmax(axis=1)), axis=1)
    both.sort(axis=1)
    both += np.arange(0, len(values), size)[:, None]
    kept = np.ones(both.shape, bool)
    kept[:, 1] = both[:, 0] != both[:, 1]
    rows: Array = both[kept]
    return rows


def _lowest_and_highest(values: Array, bucket: Array) -> Array:
    """Return the rows of the lowest and the highest number in each bucket, of one without numbers its first row."""
    of = np.cumsum(np.diff(bucket, prepend=bucket[0]) != 0)
    starts = np.concatenate(([0], np.flatnonzero(np.diff(of)) + 1))
    missing = np.isnan(values)
    candidates = ~missing | np.logical_and.reduceat(missing, starts)[of]
    kept = np.zeros(len(values), bool)
    for sign in (1.0, -1.0):
        keys = np.where(missing, np.inf, sign * values)
        hits = np.flatnonzero(candidates & (keys == np.minimum.reduceat(keys, starts)[of]))
        kept[hits[np.diff(of[hits], prepend=-1) != 0]] = True
    return np.flatnonzero(kept)


def _joined(pieces: Sequence[_Points]) -> _Points:
    moments = Moments(
        np.concatenate([one.moments.t for one in pieces]), np.concatenate([one.moments.frame for one in pieces])
    )
    return _Points(
        np.concatenate([one.place for one in pieces]), moments, np.concatenate([one.values for one in pieces])
    )
