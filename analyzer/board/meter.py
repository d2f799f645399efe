"""Rates of the last two seconds: counters in short slices of time, so that a rate does not jump."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import NO_TIME, SECOND

if TYPE_CHECKING:
    from dissectors.kit import Array

_SLICE = SECOND // 4
_SHOWN = 8  # whole slices that a rate is taken from
_KEPT = _SHOWN + 2
_SET_BACK = 4 * _KEPT  # slices that a clock must go back to begin anew


class Meter:
    """Adds up what happens at places 0 to `most` - 1, for each of `kinds` of amounts."""

    def __init__(self, most: int, kinds: int) -> None:
        self._sums = np.zeros((kinds, _KEPT, most))
        self._slice = np.full(_KEPT, -1, np.int64)
        self._newest = self._first = -1

    def feed(self, t: Array, places: Array, amounts: tuple[Array | None, ...]) -> None:
        """Take rows with their times (`NO_TIME` are left out); an amount of None counts rows."""
        if not len(t):
            return
        if int(t.min()) == NO_TIME:
            good = t != NO_TIME
            places, amounts = places[good], tuple(None if one is None else one[good] for one in amounts)
            t = t[good]
            if not len(t):
                return
        at = t // _SLICE
        newest = int(at[-1])
        if self._first < 0 or newest < self._newest - _SET_BACK:
            self._slice[:] = -1
            self._first, self._newest = int(at[0]), newest
        self._newest = max(self._newest, newest)
        for one in sorted(set(at.tolist()) if len(at) < 64 else np.unique(at).tolist()):
            if not self._newest - _KEPT < one <= self._newest:
                continue
            rows = slice(None) if at[0] == one == newest and len(t) and (at == one).all() else at == one
            self._count(one, places[rows], tuple(None if each is None else each[rows] for each in amounts))

    def _count(self, one: int, places: Array, amounts: tuple[Array | None, ...]) -> None:
        place = one % _KEPT
        if self._slice[place] != one:
            self._slice[place] = one
            self._sums[:, place] = 0
        for sums, amount in zip(self._sums, amounts, strict=True):
            found = np.bincount(places, amount)
            sums[place, : len(found)] += found

    def rates(self, now: int) -> Array:
        """Return amounts a second, by kind and place, of the last whole slices before `now`."""
        last = now // _SLICE
        shown = (self._slice >= last - _SHOWN) & (self._slice < last) & (self._slice >= 0)
        span = min(_SHOWN, last - self._first) if self._first >= 0 else 0
        if span <= 0:
            return np.zeros((len(self._sums), self._sums.shape[2]))
        found: Array = self._sums[:, shown].sum(axis=1) / (span * _SLICE / SECOND)
        return found
