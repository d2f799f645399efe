"""How long periods are."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from dissectors.kit import Array


class PeriodHistogram:
    """A histogram of positive times in ns: bins of 0.1 % width, from 1 us to more than a minute."""

    _LOW = int(np.float32(1e3).view(np.int32)) >> 13
    _HIGH = int(np.float32(1e11).view(np.int32)) >> 13

    def __init__(self) -> None:
        # Bins that are not empty, in order, and how many times each has: a device has one, and few bins.
        self._bins, self._times = np.empty(0, np.int32), np.empty(0, np.uint32)
        self.count = 0

    def feed(self, periods: Array) -> None:
        """Add periods; those that are not positive are left out."""
        periods = periods[periods > 0]
        if not len(periods):
            return
        code = (periods.astype(np.float32).view(np.int32) >> 13).clip(self._LOW, self._HIGH)
        low = int(code.min())
        counted = np.bincount(code - low).astype(np.uint32)
        new = np.flatnonzero(counted).astype(np.int32)
        bins = np.union1d(self._bins, new + low)
        times = np.zeros(len(bins), np.uint32)
        times[np.searchsorted(bins, self._bins)] = self._times
        times[np.searchsorted(bins, new + low)] += counted[new]
        self._bins, self._times = bins, times
        self.count += len(periods)

    def below(self, share: float) -> float:
        """Return the time that this share of them, at least one, does not exceed."""
        at = self._bins.item(np.searchsorted(np.cumsum(self._times), share * self.count))
        low, high = (np.array([at + k << 13], np.int32).view(np.float32)[0] for k in (0, 1))
        return float(low + high) / 2
