"""One motor: which of its reports are not as its past says."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer import _native
from analyzer.decode.sent import cells
from analyzer.flight.thresholds import threshold

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from analyzer.flight.clock import RowPlaces, Spot
    from analyzer.flight.motors.reports import EscReports
    from dissectors.kit import Array


# In which ways a report can be well: as it should be; its motor turns fast enough for the lowest of the commands before
# it; it gives what is commanded; it takes what its load takes, though it gains no speed, or as it may gain some. The
# others than the first also tell while commands change.
WAYS = 5
GOOD, TURNING, GIVEN, LOADED, DRAWING = range(WAYS)
_NONE = np.zeros(0)


class ComparedReports(NamedTuple):
    """Reports against the past: `off` are those that differ; of others there are no further columns if none does.

    `speed` and `current` are shares of what they were at such a command, `reported` of what is commanded. `well` are
    the rows of the last reports before each that were well, a column each way, -1 where that is `earlier`.
    """

    off: Array
    well: Array
    earlier: Sequence[Spot | None]
    speed: Array
    current: Array
    reported: Array
    at: RowPlaces

    def before(self, row: int) -> list[Spot | None]:
        """Return the last reports before one that were well, each way."""
        rows = self.well[row].tolist()
        spots = {last: self.at.at(last) for last in set(rows) if last >= 0}  # mostly the same one each way
        return [spots.get(last, earlier) for last, earlier in zip(rows, self.earlier, strict=True)]


class MotorWatch:
    """Takes the reports of one device, in order."""

    def __init__(self) -> None:
        self._native = _native.MotorWatch(_limits())
        self._well: list[Spot | None] = [None] * WAYS  # the last reports that were so
        self.first: Spot | None = None  # of all
        self.learned: Spot | None = None  # the first one that is well by its past

    def feed(self, some: EscReports) -> ComparedReports:
        """Compare the next reports, in any pieces; those without a speed, a voltage or commands do not count."""
        kept, off, last, learned = self._native.feed(some.rows, some.part.start, some.part.stop)
        at = some.at if kept is None else some.at.take(cells(kept, np.int64))
        if self.first is None and len(at):
            self.first = at.at(0)
        earlier, spots = self._well, {row: at.at(row) for row in set(last) if row >= 0}
        self._well = [spots.get(row, known) for row, known in zip(last, earlier, strict=True)]
        if self.learned is None and learned >= 0:
            self.learned = at.at(learned)
        if off is None:
            return ComparedReports(np.zeros(len(at), bool), _NONE, earlier, _NONE, _NONE, _NONE, at)
        differs, well, shares = off
        speed, current, reported = (cells(column, np.float64) for column in shares)
        before = cells(well, np.int64).reshape(-1, WAYS)
        return ComparedReports(cells(differs, np.uint8).view(bool), before, earlier, speed, current, reported, at)


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
        "given": threshold("motor_given"),
        "sag_begun": threshold("sag_begun_percent") / 100,
    }
