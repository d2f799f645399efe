"""The times of a capture that can be believed: a stamp far off those around it is no reading of its clock."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.facts.traffic import times
from dissectors.times import SECOND

if TYPE_CHECKING:
    from analyzer.decode.engine import Batch
    from dissectors.kit import Array

MOST_STRAY = 64  # stamps whose place is kept
_FAR = SECOND
_FIRST_FAR = 10 * SECOND  # before anything else there may be a pause
_STEPS = 50  # times the usual step between frames
_BESIDE = 3  # frames to each side that tell what time it was
_OUTER = 5  # frames at an end, of which two may be wrong


class BelievedTimes:
    """Adds up batches: `start` and `end` in ns of what is believed, None without times, and how many stamps `stray`.

    Up to two stray stamps in a row are told from a clock that was set.
    """

    def __init__(self) -> None:
        self.start: int | None = None
        self.end: int | None = None
        self.stray = 0
        self._places: dict[int, int] = {}
        self._last: Array = np.zeros(0, np.int64)

    def feed(self, batch: Batch) -> None:
        """Add the next batch."""
        t, timed = times(batch.frames)
        t = t[timed].astype(np.int64)
        if not len(t):
            return
        before, self._last = self._last, np.concatenate((self._last, t))[-_BESIDE:]
        far = np.where(np.arange(len(t)) < (0 if len(before) else _BESIDE), _FIRST_FAR, _FAR)
        steps = np.abs(np.diff(t, prepend=before[-1] if len(before) else t[0]))
        believed = t
        if (steps > _FAR).any():
            around = _around(before, t)
            stray = np.abs(t - around) > np.maximum(far, _STEPS * int(np.median(steps)))
            self.stray += int(stray.sum())
            for row in np.flatnonzero(stray)[: MOST_STRAY - len(self._places)].tolist():
                self._places[int(t[row])] = int(around[row])
            believed = t[~stray]
        if len(believed):
            low, high = int(believed.min()), int(believed.max())
            self.start = low if self.start is None else min(low, self.start)
            self.end = high if self.end is None else max(high, self.end)

    def holds(self, t: Array) -> Array:
        """Return which times, of batches that were added, are believed."""
        if not self.stray or self.start is None or self.end is None:
            return np.ones(len(t), bool)
        return (t >= self.start) & (t <= self.end)

    def believed(self, t: int) -> int:
        """Return a time, or for a stray one what it was meanwhile."""
        if not self.stray or self.start is None or self.end is None:
            return t
        return min(max(self._places.get(t, t), self.start), self.end)


def _around(before: Array, t: Array) -> Array:
    """Return the median of the stamps around each.

    Before the first ones of a capture stands what most of the first five say, behind the last ones of a batch what most
    of the last five say: so two in a row are fewer than the others there, too.
    """
    left = before if len(before) == _BESIDE else _most(t[:_OUTER])
    padded = np.concatenate((left, t, _most(np.concatenate((before, t))[-_OUTER:])))
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * _BESIDE + 1)
    median: Array = np.median(windows, axis=1).astype(np.int64)
    return median


def _most(t: Array) -> Array:
    """Return what most of some stamps say, as often as frames are needed to a side."""
    return np.sort(t)[[(len(t) - 1) // 2] * _BESIDE]
