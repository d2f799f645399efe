"""Counters that start again at 0 behind their largest value, continued (4.4.5 no 26-27: 16 bits of seconds, 18.2 h)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from dissectors.kit import Array


MAX_COUNTERS = 65_536


class Unwrapper:
    """One field of `bits` bits of many senders: what each last showed, and how far it has wrapped.

    A value that is lower than the one before it by more than half of the range has wrapped. Any other lower one is a
    restart: the counter goes on from the value itself, without the wraps so far. A counter above the first
    `MAX_COUNTERS` is not remembered from one call to the next.
    """

    def __init__(self, bits: int) -> None:
        self._range = 1 << bits
        self._last: dict[int, tuple[int, int]] = {}  # counter -> raw value, sum of the wraps before it

    def follow(self, counters: Array, raw: Array) -> Array:
        """Return raw values, in the order sent, continued as u64; `counters` (integers) tell whose each is."""
        if not len(raw):
            return np.empty(0, np.uint64)
        order = np.argsort(counters, kind="stable")
        mine, values = counters[order], raw[order].astype(np.int64)
        fresh = np.ones(len(mine), bool)
        fresh[1:] = mine[1:] != mine[:-1]
        first = np.flatnonzero(fresh)
        names = mine[first].tolist()
        known = [self._last.get(name) or (start, 0) for name, start in zip(names, values[first].tolist(), strict=True)]
        before = np.empty_like(values)
        before[1:] = values[:-1]
        before[first] = [last for last, _ in known]
        drop = before - values
        wraps = drop > self._range // 2
        restarts = (drop > 0) & ~wraps
        # A run begins with a counter or a restart; in it, what the wraps add up to only grows.
        runs = np.flatnonzero(fresh | restarts)
        total = np.cumsum(wraps) * self._range
        base = np.zeros(len(values), np.int64)
        base[first] = [wrapped for _, wrapped in known]
        base[restarts] = 0
        start = base[runs] - (total[runs] - wraps[runs] * self._range)
        added = total + np.repeat(start, np.diff(runs, append=len(values)))
        last = np.append(first[1:], len(values)) - 1
        for name, value, wrapped in zip(names, values[last].tolist(), added[last].tolist(), strict=True):
            if name in self._last or len(self._last) < MAX_COUNTERS:
                self._last[name] = value, wrapped
        out = np.empty(len(values), np.uint64)
        out[order] = values + added
        return out
