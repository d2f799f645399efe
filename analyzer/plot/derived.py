"""Quantities that are computed from others: energy from power, periods from times. They remember a row a line."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dissectors.kit import MILLISECOND, NO_TIME, SECOND

if TYPE_CHECKING:
    from dissectors.kit import Array

PAUSE = 2 * SECOND  # a longer silence is not bridged: nobody knows what happened meanwhile


class _Last(NamedTuple):
    """The end of a line: time, value, sum so far."""

    t: int
    value: float
    total: float


class Integrals:
    """Sums over time by the trapezoid rule, for each line; rows without a time or a number, and pauses, add nothing."""

    def __init__(self) -> None:
        self._last: dict[str, _Last] = {}

    def add(self, line: str, t: Array, values: Array, scale: float) -> Array:
        """Return the sum behind each row; no number before there is any time."""
        good = np.flatnonzero((t != NO_TIME) & np.isfinite(values))
        before = self._last.get(line)
        if not len(good):
            return np.full(len(values), before.total if before else np.nan)
        times, numbers = t[good], values[good].astype(np.float64)
        if before is None:
            before = _Last(int(times[0]), float(numbers[0]), 0.0)
        steps = np.diff(times, prepend=before.t)
        means = (numbers + np.concatenate(([before.value], numbers[:-1]))) / 2
        parts = np.where((steps > 0) & (steps <= PAUSE), means * (steps / SECOND) * scale, 0.0)
        sums = np.cumsum(np.concatenate(([before.total], parts)))  # in order, so that cuts between batches do not show
        self._last[line] = _Last(int(times[-1]), float(numbers[-1]), float(sums[-1]))
        if len(good) == len(values):
            return np.asarray(sums[1:])
        total: Array = sums[np.searchsorted(good, np.arange(len(values)), side="right")]
        return total


class RowPeriods:
    """Times between the rows of a line, in ms, and how much they changed."""

    def __init__(self) -> None:
        self._last: dict[str, tuple[int, float]] = {}

    def add(self, line: str, t: Array) -> tuple[Array, Array]:
        """Return period and change of period of each row; no number where there is nothing to compare with."""
        periods = np.full(len(t), np.nan)
        changes = np.full(len(t), np.nan)
        good = np.flatnonzero(t != NO_TIME)
        if not len(good):
            return periods, changes
        before, period = self._last.get(line, (NO_TIME, np.nan))
        times = t[good]
        own = np.diff(times, prepend=times[0] if before == NO_TIME else before) / MILLISECOND
        if before == NO_TIME:
            own[0] = np.nan
        periods[good] = own
        changes[good] = np.abs(np.diff(own, prepend=period))
        self._last[line] = int(times[-1]), float(own[-1])
        return periods, changes
