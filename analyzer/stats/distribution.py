"""Quantiles of any number of values in bounded memory.

Up to `EXACT` values are kept, and quantiles of them are exact (interpolated, as numpy and pandas do). Of more values
only how many there are in buckets: a quantile is then at most `ERROR` of itself away from a value that it may be.
Count, mean, minimum and maximum are exact at any length, and nothing depends on how the values were cut into batches.
"""

from __future__ import annotations

from collections import Counter
from fractions import Fraction
from math import ceil, exp, log
from typing import TYPE_CHECKING

import numpy as np

from analyzer.tables import counted
from dissectors.kit.cells import floats

if TYPE_CHECKING:
    from dissectors.kit import Array

EXACT = 1024
ERROR = 0.005
_WIDTH = log((1 + ERROR) / (1 - ERROR))
_LOW, _HIGH = 1e-9, 1e15  # what is nearer to 0 counts as 0, what is larger as that
_SHIFT = 1 + ceil(-log(_LOW) / _WIDTH)  # makes the number of a bucket positive
_HALF = 1 << 26  # halves of the 53 bits of a float, so that many of them can be added
_NONE = np.zeros(0)


class Distribution:
    """Values of one kind: `feed(values)`, then `quantile`, `mean`, `low` and `high`.

    What is not finite is `left_out`.
    """

    __slots__ = ("_buckets", "_kept", "_sum", "count", "high", "left_out", "low")

    def __init__(self) -> None:
        self.count = self.left_out = 0
        self.low = self.high = 0.0
        self._sum = Fraction(0)
        self._kept: Array = _NONE
        self._buckets: Counter[int] = Counter()

    def feed(self, values: Array) -> None:
        """Add values of any dtype of numbers."""
        values = floats(values)
        finite = np.isfinite(values)
        if not finite.all():
            self.left_out += len(values) - int(finite.sum())
            values = values[finite]
        if not len(values):
            return
        low, high = float(values.min()), float(values.max())
        self.low, self.high = (min(self.low, low), max(self.high, high)) if self.count else (low, high)
        self.count += len(values)
        self._sum += _exact_sum(values)
        if not self._buckets and self.count <= EXACT:
            self._kept = np.concatenate((self._kept, values))
            return
        self._fill(np.concatenate((self._kept, values)) if len(self._kept) else values)
        self._kept = _NONE

    def join(self, other: Distribution) -> None:
        """Add all values that another one has."""
        if not other.count:
            return
        self.low = min(self.low, other.low) if self.count else other.low
        self.high = max(self.high, other.high) if self.count else other.high
        self.count += other.count
        self.left_out += other.left_out
        self._sum += other._sum
        kept = np.concatenate((self._kept, other._kept))
        if self.count <= EXACT and not self._buckets and not other._buckets:
            self._kept = kept
            return
        self._fill(kept)
        self._kept = _NONE
        self._buckets.update(other._buckets)

    @property
    def mean(self) -> float | None:
        """The mean, None of no values."""
        return float(self._sum / self.count) if self.count else None

    @property
    def total(self) -> float:
        """The sum."""
        return float(self._sum)

    def quantile(self, share: float) -> float | None:
        """Return the value that this share of them does not exceed, None of no values."""
        if not self.count:
            return None
        if not self._buckets:
            return float(np.quantile(self._kept, share))
        rank, below = share * (self.count - 1), 0
        for bucket in sorted(self._buckets):
            below += self._buckets[bucket]
            if below > rank:
                break
        return min(max(_middle(bucket), self.low), self.high)

    def _fill(self, values: Array) -> None:
        size = np.abs(values)
        near = size < _LOW
        exponents = np.log(np.clip(size, _LOW, _HIGH)) / _WIDTH
        buckets = np.floor(exponents).astype(np.int64) + _SHIFT
        buckets = np.where(near, 0, np.where(values < 0, -buckets, buckets))
        for bucket, count in zip(*counted(buckets), strict=True):
            self._buckets[bucket] += count


def _middle(bucket: int) -> float:
    if not bucket:
        return 0.0
    size = exp((abs(bucket) - _SHIFT + 0.5) * _WIDTH)
    return size if bucket > 0 else -size


def _exact_sum(values: Array) -> Fraction:
    """Return the sum without rounding, so that it is the same in any order."""
    mantissa, exponent = np.frexp(values)
    whole = np.ldexp(mantissa, 53).astype(np.int64)
    total = Fraction(0)
    for power in np.unique(exponent).tolist():
        some = whole[exponent == power]
        upper = some // _HALF
        parts = int(upper.sum()) * _HALF + int((some - upper * _HALF).sum())
        total += Fraction(parts) * Fraction(2) ** (power - 53)
    return total
