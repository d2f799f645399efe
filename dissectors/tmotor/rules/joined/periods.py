"""How long periods are."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit.order import changes, steps

if TYPE_CHECKING:
    from dissectors.kit import Array

_MOST_LEFT, _MOST_PARTS = 1 << 12, 64


class PeriodHistogram:
    """A histogram of positive times in ns: bins of 0.1 % width, from 1 us to more than a minute."""

    _LOW = int(np.float32(1e3).view(np.int32)) >> 13
    _HIGH = int(np.float32(1e11).view(np.int32)) >> 13

    def __init__(self) -> None:
        # Bins that are not empty, in order, and how many times each has: a device has one, and few bins.
        self._bins, self._times = np.empty(0, np.int32), np.empty(0, np.uint32)
        self._counted = 0
        self._new: list[Array] = []  # what is not in it yet: a live batch brings few, which cost as much as many
        self._left = 0

    @property
    def count(self) -> int:
        """How many there are."""
        self._add()
        return self._counted

    def feed(self, periods: Array) -> None:
        """Add periods; those that are not positive are left out."""
        periods = periods[periods > 0]  # a copy: of a view all that it is a part of would stay
        if not len(periods):
            return
        self._new.append(periods)
        self._left += len(periods)
        if self._left > _MOST_LEFT or len(self._new) > _MOST_PARTS:
            self._add()

    def _add(self) -> None:
        if not self._new:
            return
        periods = self._new[0] if len(self._new) == 1 else np.concatenate(self._new)
        self._new, self._left = [], 0
        code = np.maximum(periods.astype(np.float32).view(np.int32) >> 13, self._LOW)
        np.minimum(code, self._HIGH, out=code).sort()
        first = changes(code, -1)
        bins = code[first]
        at = np.searchsorted(self._bins, bins)
        new = np.flatnonzero(np.append(self._bins, -1)[at] != bins)
        if len(new):
            self._bins = np.insert(self._bins, at[new], bins[new])
            self._times = np.insert(self._times, at[new], 0)
            at = np.searchsorted(self._bins, bins)
        self._times[at] += steps(np.append(first[1:], len(code)), 0).astype(np.uint32)
        self._counted += len(periods)

    def below(self, share: float) -> float:
        """Return the time that this share of them, at least one, does not exceed."""
        count = self.count
        at = self._bins.item(np.searchsorted(np.cumsum(self._times), share * count))
        low, high = (np.array([at + k << 13], np.int32).view(np.float32)[0] for k in (0, 1))
        return float(low + high) / 2
