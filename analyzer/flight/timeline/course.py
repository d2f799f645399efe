"""Courses: values over recorded time, of which each step keeps the lowest and the highest, in bounded memory.

The last minutes are kept in fine steps, what is older in coarser ones: nobody knows before the end which minute it is
that matters.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dissectors.times import MILLISECOND

if TYPE_CHECKING:
    from dissectors.kit import Array

MOST_STEPS = 1 << 13  # of each size
_FINEST, _TIMES, _SIZES = 25 * MILLISECOND, 8, 4  # 3.4 min, 27 min, 3.6 h, 29 h
_FIRST = 256  # steps that there is room for from the start


class CourseCut(NamedTuple):
    """A part of a course: where each step with values begins, how long steps are (ns), and their values, a row each."""

    start: Array
    step: int
    low: Array
    high: Array


class DeviceValues:
    """Values of one device, `rows` of them at each time; NaN where one is not known."""

    def __init__(self, rows: int) -> None:
        self._levels = [_Level(rows, _FINEST * _TIMES**k) for k in range(_SIZES)]

    def widen(self, rows: int) -> None:
        """Make room for more values at each time."""
        for level in self._levels:
            level.widen(rows)

    def feed(self, ran: Array, values: Array) -> None:
        """Take the next values: recorded times (ns), and a column of values (f32) for each."""
        if not len(ran):
            return
        if (np.diff(ran) < 0).any():
            order = np.argsort(ran, kind="stable")
            ran, values = ran[order], values[:, order]
        steps, low, high = ran // _FINEST, values, values
        for level in self._levels:
            begins = np.flatnonzero(np.diff(steps, prepend=steps[0] - 1))
            if len(begins) < len(steps):
                low, high = (find.reduceat(one, begins, axis=1) for find, one in ((np.fmin, low), (np.fmax, high)))
                steps = steps[begins]
            level.feed(steps, low, high)
            steps = steps // _TIMES

    def cut(self, start: int, stop: int) -> CourseCut:
        """Return what was from `start` to before `stop`, in the finest steps that go back so far."""
        level = next((one for one in self._levels if one.begins <= start), self._levels[-1])
        return level.cut(start, stop)


class _Level:
    """A ring of steps of one size; `_step` says which step stands in which place, -1 for none."""

    def __init__(self, rows: int, size: int) -> None:
        self.size = size
        self._first = self._newest = -1
        self._step = np.full(_FIRST, -1, np.int64)
        self._low, self._high = (np.full((rows, _FIRST), np.nan, np.float32) for _ in range(2))

    @property
    def begins(self) -> int:
        """The recorded time from which on nothing is left out."""
        oldest = self._newest - len(self._step) + 1
        return -1 if self._first >= oldest else oldest * self.size

    def widen(self, rows: int) -> None:
        """Make room for more values at each time."""
        more = np.full((rows - len(self._low), len(self._step)), np.nan, np.float32)
        self._low, self._high = (np.concatenate((kept, more)) for kept in (self._low, self._high))

    def feed(self, steps: Array, low: Array, high: Array) -> None:
        """Take steps, each once and in order, and their values."""
        first = int(steps[0])
        self._first = first if self._first < 0 else min(self._first, first)
        self._newest = max(self._newest, int(steps[-1]))
        self._grow()
        kept = int(np.searchsorted(steps, self._newest - len(self._step), "right"))
        if kept:
            steps, low, high = steps[kept:], low[:, kept:], high[:, kept:]
        places = steps & (len(self._step) - 1)
        again = np.flatnonzero(self._step[places] == steps)
        if len(again):
            low, high = low.copy(), high.copy()
            low[:, again] = np.fmin(low[:, again], self._low[:, places[again]])
            high[:, again] = np.fmax(high[:, again], self._high[:, places[again]])
        self._step[places], self._low[:, places], self._high[:, places] = steps, low, high

    def _grow(self) -> None:
        room = len(self._step)
        while room < MOST_STEPS and self._newest - self._first >= room:
            room *= 2
        if room == len(self._step):
            return
        old, filled = self._step, np.flatnonzero(self._step >= 0)
        places = old[filled] & (room - 1)
        self._step = np.full(room, -1, np.int64)
        self._step[places] = old[filled]
        for name in ("_low", "_high"):
            kept = getattr(self, name)
            more = np.full((len(kept), room), np.nan, np.float32)
            more[:, places] = kept[:, filled]
            setattr(self, name, more)

    def cut(self, start: int, stop: int) -> CourseCut:
        """Return the steps of a time."""
        first = max(start // self.size, self._newest - len(self._step) + 1, 0)
        steps = np.arange(first, min(-(-stop // self.size), self._newest + 1), dtype=np.int64)
        places = steps & (len(self._step) - 1)
        steps, places = (one[self._step[places] == steps] for one in (steps, places))
        return CourseCut(steps * self.size, self.size, self._low[:, places], self._high[:, places])
