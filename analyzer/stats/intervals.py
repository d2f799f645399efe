"""Sums by interval of time: only intervals in which something happens take room."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import groups
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from dissectors.kit import Array

MOST_INTERVALS = 1_000_000  # that hold something
_MOST_EMPTY = 100_000  # intervals that are told although there is nothing in most of them


class TooManyIntervalsError(ValueError):
    """The interval is too short for a capture of this length."""


class Intervals:
    """Counts, added up by the interval that their time is in.

    Args:
        step: length of an interval in nanoseconds, 0 for one over all.

    `origin` is where the first one begins.
    """

    def __init__(self, step: int) -> None:
        self._step, self.origin = step, 0
        self._sums: dict[int, int] = {}
        self.total = 0

    def feed(self, t: Array, amounts: Array | None, sign: int) -> None:
        """Add amounts (1 each without any) at their times, or take them away."""
        if not len(t):
            return
        whole = len(t) if amounts is None else int(amounts.sum(dtype=np.int64))
        self.total += sign * whole
        for number, amount in _by_interval(t, self.origin, self._step, amounts):
            self._sums[number] = self._sums.get(number, 0) + sign * amount

    def check(self) -> None:
        """Raise `TooManyIntervalsError` if there are more than anybody reads."""
        if len(self._sums) > MOST_INTERVALS:
            raise TooManyIntervalsError(
                f"more than {MOST_INTERVALS} intervals hold something: a longer INTERVAL is needed"
            )

    def at(self, number: int) -> int:
        """Return the sum of an interval."""
        return self._sums.get(number, 0)

    def numbers(self, until: int) -> Sequence[int]:
        """Return the intervals in order, empty ones too up to that of a time, if they are not too many."""
        first, last = min(0, 0, *self._sums), max(0, *self._sums, *_numbers(np.array([until]), self.origin, self._step))
        if not self._sums:
            return [first]
        if last - first < max(2 * len(self._sums), _MOST_EMPTY):
            return range(first, last + 1)
        return sorted(self._sums)


@dataclass(slots=True)
class _Extent:
    """Values of an interval."""

    count: int = 0
    total: float = 0.0
    low: float = float("inf")
    high: float = float("-inf")

    def add(self, values: Array) -> None:
        self.count += len(values)
        self.total += float(values.sum(dtype=np.float64))
        self.low, self.high = min(self.low, float(values.min())), max(self.high, float(values.max()))

    def measure(self, name: str) -> float | None:
        if name == "COUNT":
            return self.count
        if not self.count:
            return None
        return {"SUM": self.total, "MIN": self.low, "MAX": self.high, "AVG": self.total / self.count}[name]


class Spread:
    """Values by interval: how many, their sum, the smallest and the largest. See `Intervals`.

    What is not finite is left out.
    """

    def __init__(self, step: int) -> None:
        self._step, self.origin = step, 0
        self._found: dict[int, _Extent] = {}
        self._all = _Extent()

    def feed(self, t: Array, values: Array) -> None:
        """Add values at their times."""
        good = np.isfinite(values)
        t, values = t[good], values[good]
        if not len(t):
            return
        self._all.add(values)
        numbers = _numbers(t, self.origin, self._step)
        lowest = int(numbers.min())
        for number, at in groups(numbers - lowest):
            if len(self._found) <= MOST_INTERVALS:
                self._found.setdefault(number + lowest, _Extent()).add(values[at])

    def at(self, number: int, measure: str) -> float | None:
        """Return a measure of an interval, None of nothing."""
        return self._found.get(number, _Extent()).measure(measure)

    def whole(self, measure: str) -> float | None:
        """Return a measure of all."""
        return self._all.measure(measure)


def _numbers(t: Array, origin: int, step: int) -> Array:
    found: Array = (t - origin) // step if step else np.zeros(len(t), np.int64)
    return found


def _by_interval(t: Array, origin: int, step: int, amounts: Array | None) -> Iterator[tuple[int, int]]:
    numbers = _numbers(t, origin, step)
    rises = bool((numbers[1:] >= numbers[:-1]).all())
    if not rises:
        order = np.argsort(numbers, kind="stable")
        numbers, amounts = numbers[order], None if amounts is None else amounts[order]
    starts = np.append(0, np.flatnonzero(numbers[1:] != numbers[:-1]) + 1)
    sums = np.diff(starts, append=len(t)) if amounts is None else np.add.reduceat(amounts, starts, dtype=np.int64)
    yield from zip(numbers[starts].tolist(), sums.tolist(), strict=True)
