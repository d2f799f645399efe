"""One motor: which of its reports are not as its past says."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer import _native
from analyzer.decode.sent import cells
from analyzer.flight.thresholds import threshold

if TYPE_CHECKING:
    from collections.abc import Mapping

    from analyzer.flight.clock import Places, Spot
    from analyzer.flight.motors.reports import EscReports
    from dissectors.kit import Array


class Compared(NamedTuple):
    """Reports against the past: `off` are those that differ.

    `speed` and `current` are shares of what they were at such a command, `reported` of what is commanded. `good` are
    the rows of the last good report before each, -1 where that is `earlier`.
    """

    off: Array
    good: Array
    earlier: Spot | None
    speed: Array
    current: Array
    reported: Array
    at: Places

    def before(self, row: int) -> Spot | None:
        """Return the last good report before one: changes hide much."""
        good = int(self.good[row])
        return self.at.at(good) if good >= 0 else self.earlier


class MotorWatch:
    """Takes the reports of one device, in order."""

    def __init__(self) -> None:
        self._native = _native.MotorWatch(_limits())
        self._good: Spot | None = None  # the last report that was as it should be

    def feed(self, some: EscReports) -> Compared:
        """Compare the next reports, in any pieces; all have a speed, a voltage and commands before them."""
        at, columns = some.at, (some.speed, some.volts, some.current, some.reported)
        off, good, shares, last = self._native.feed(columns, some.command)
        speed, current, reported = (cells(column, np.float64) for column in shares)
        before, earlier = cells(good, np.int64), self._good
        if last >= 0:
            self._good = at.at(last)
        return Compared(cells(off, np.uint8).view(bool), before, earlier, speed, current, reported, at)


@cache
def _limits() -> Mapping[str, float]:
    return {
        "learned": threshold("motor_learned"),
        "steady_percent": threshold("motor_steady_percent"),
        "even_percent": threshold("motor_even_percent"),
        "slow": threshold("motor_slow"),
        "fast": threshold("motor_fast"),
        "unloaded": threshold("motor_unloaded"),
        "dragged": threshold("motor_dragged"),
        "worn": threshold("motor_worn"),
        "many": int(threshold("motor_many")),
        "far": threshold("motor_far"),
        "least_a": threshold("motor_least_a"),
        "sag_begun": threshold("sag_begun_percent") / 100,
    }
