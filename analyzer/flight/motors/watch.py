"""One motor: which of its reports are not as its past says."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.flight.motors.past import LAW, MotorPast
from analyzer.flight.thresholds import threshold

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.flight.clock import Places, Spot
    from analyzer.flight.motors.reports import EscReports
    from dissectors.kit import Array

_GOOD = 0.85, 1.2  # a current as a share of what it was at that speed


class Compared(NamedTuple):
    """Reports against the past: `off` are those that differ, `before` is the last good report before a run of them.

    `speed` and `current` are shares of what they were at such a command, `reported` of what is commanded.
    """

    off: Array
    before: list[Spot | None]
    speed: Array
    current: Array
    reported: Array
    at: Places


class MotorWatch:
    """Takes the reports of one device, in order."""

    def __init__(self) -> None:
        self._past = MotorPast()
        self._ratios = np.full(int(threshold("motor_many")) - 1, np.nan)  # of current to what it was at that speed
        self._volts = np.full(int(threshold("motor_many")), -np.inf)
        self._good: Spot | None = None  # the last report that was as it should be

    def feed(self, some: EscReports) -> Iterator[Compared]:
        """Compare the next reports; a past is drawn after certain numbers of them, however they come."""
        start = 0
        for count in self._past.steps(len(some.speed)):
            yield self._compared(some.take(slice(start, start + count)))
            start += count

    def _compared(self, some: EscReports) -> Compared:
        command, steady_percent = some.command, threshold("motor_steady_percent")
        off, speed, current, ratio = _differing(self._past, some)
        worn = self._worn(np.where(self._steady_supply(some.volts), ratio, np.nan))
        good = (ratio > _GOOD[0]) & (ratio < _GOOD[1])
        off = off | worn
        before = self._begun(off, good & ~off, some.at)
        steady = command.most - command.least <= steady_percent
        driven = (command.least > steady_percent) & (some.speed > 0)
        calm = steady & driven & ~off & np.isfinite(some.current) & (good | np.isnan(ratio))
        self._past.add(command.mean, some.speed, some.volts, some.current, calm)
        with np.errstate(divide="ignore", invalid="ignore"):
            reported = some.reported / command.last
        return Compared(off, before, speed, current, reported, some.at)

    def _worn(self, ratio: Array) -> Array:
        """Return which reports have a current that is low, at their speed, in the mean of many; NaN says nothing."""
        many = len(self._ratios) + 1
        every = np.concatenate((self._ratios, ratio))
        self._ratios = every[len(every) - many + 1 :]
        good = np.isfinite(every)
        sums, counts = (np.concatenate(([0.0], np.cumsum(one))) for one in (np.where(good, every, 0.0), good))
        total, count = (one[many:] - one[:-many] for one in (sums, counts))
        low: Array = (count == many) & (total < threshold("motor_worn") * many)
        return low

    def _steady_supply(self, volts: Array) -> Array:
        """Return which reports have a voltage that did not fall before them: a motor that slows down takes less."""
        many = len(self._volts)
        every = np.concatenate((self._volts, volts))
        self._volts = every[-many:]
        most = np.lib.stride_tricks.sliding_window_view(every, many + 1).max(axis=1)
        steady: Array = volts >= most * (1 - threshold("sag_begun_percent") / 100)
        return steady

    def _begun(self, off: Array, good: Array, at: Places) -> list[Spot | None]:
        """Return, where a run of reports begins that are off, the last good one before: changes hide much."""
        rows = np.flatnonzero(good)
        before: list[Spot | None] = [None] * len(off)
        for row in np.flatnonzero(off & ~np.append([False], off[:-1])).tolist():
            place = int(np.searchsorted(rows, row)) - 1
            before[row] = at.at(int(rows[place])) if place >= 0 else self._good
        if len(rows):
            self._good = at.at(int(rows[-1]))
        return before


def _differing(past: MotorPast, some: EscReports) -> tuple[Array, Array, Array, Array]:
    """Return which reports differ, speed and current as shares of the past, and the current as one at this speed.

    The last is NaN where it says nothing: while the commands change much, or the motor slows down.
    """
    command, unknown = some.command, np.full(len(some.speed), np.nan)
    at_mean = past.expected(command.mean, some.volts)
    driven = command.least > threshold("motor_steady_percent")
    if at_mean is None or not driven.any():
        return np.zeros(len(unknown), bool), unknown, unknown, unknown
    with np.errstate(divide="ignore", invalid="ignore"):
        speed, current = some.speed / at_mean.speed, some.current / at_mean.current
        slowest, fastest = (at_mean.speed * one / command.mean for one in (command.least, command.most))
        wide = np.where(at_mean.far, threshold("motor_far"), 1.0)
        slow = some.speed / slowest < 1 - (1 - threshold("motor_slow")) * wide
        fast = some.speed / fastest > 1 + (threshold("motor_fast") - 1) * wide
        wanted = at_mean.current * speed**LAW
        ratio = np.where(wanted > threshold("motor_least_a"), some.current / wanted, np.nan)
        even = command.most - command.least <= threshold("motor_even_percent")
        few = command.last >= command.mean - threshold("motor_steady_percent") / 3
        much = command.last <= command.mean + threshold("motor_steady_percent") / 3
        unloaded = even & few & (ratio < threshold("motor_unloaded") / wide)
        dragged = even & much & (ratio > threshold("motor_dragged") * wide)
    off = driven & (slow | (fast & few & ~(ratio > 1)) | unloaded | dragged)
    return off, speed, current, np.where(driven & even & few, ratio, np.nan)
