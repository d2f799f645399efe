"""One motor: which of its reports are not as its past says."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer import _native
from analyzer.decode.sent import cells
from analyzer.flight.thresholds import lasting, threshold

if TYPE_CHECKING:
    from collections.abc import Mapping

    from analyzer.flight.clock import Places, Spot
    from analyzer.flight.motors.commanded import ChannelOrders
    from analyzer.flight.motors.reports import MotorReports
    from dissectors.kit import Array


class Compared(NamedTuple):
    """Reports that have commands before them, against the past: `off` are those that differ.

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

    def feed(self, some: MotorReports, orders: ChannelOrders) -> Compared | None:
        """Compare the next reports, however they come in pieces; None if none of them has a command before it."""
        at = some.at
        columns = some.speed, some.volts, some.current, some.reported, at.ran, at.frame
        found, off, good, shares, last = self._native.feed(columns, orders)
        rows = cells(found, np.int64)
        if not len(rows):
            return None
        at = at if len(rows) == len(at) else at.take(rows)
        speed, current, reported = (cells(column, np.float64) for column in shares)
        before, earlier = cells(good, np.int64), self._good
        if last >= 0:
            self._good = at.at(last)
        return Compared(cells(off, np.uint8).view(bool), before, earlier, speed, current, reported, at)


@cache
def _limits() -> Mapping[str, float]:
    return {
        "window_ns": lasting("motor_window"),
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
