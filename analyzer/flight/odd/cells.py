"""The reports of one ESC as sums by time and bin: whole numbers, so that any cut of a capture gives the same."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer import _native
from analyzer.decode.sent import cells
from analyzer.flight.odd.quantities import BINNED, BINS
from analyzer.flight.thresholds import idle_rpm, lasting, threshold

if TYPE_CHECKING:
    from analyzer.flight.motors.reports import EscReports
    from dissectors.kit import Array
    from dissectors.picture import Plot

SLOTS = 128  # of time; when they are full, two become one
ONE = float(1 << 20)  # of anything that is measured, as a whole number
NEVER = np.iinfo(np.int64).max
MEASURED = ("temperature", "voltage", "power")  # sums by time alone
COUNTED = ("came", "lost", "late")


class EscCells:
    """Takes the reports of one device, in order. Bound: `SLOTS` by `BINS` sums of each kind."""

    def __init__(self, plot: Plot, key: int) -> None:
        self.plot, self.key = plot, key
        self._native = _native.EscSums(
            {
                "idle_rpm": idle_rpm(plot),
                "least_a": threshold("motor_least_a"),
                "command_idle_percent": threshold("command_idle_percent"),
                "steady_percent": threshold("motor_steady_percent"),
                "steady_speed": threshold("steady_speed"),
                "silent": lasting("silent_motor"),
                "late_periods": threshold("late_periods"),
            }
        )
        self._sums: list[Array] = []  # until something is added to them

    def feed(self, some: EscReports, start: int, width: int) -> None:
        """Add the next reports; slots of `width` ns count from `start`."""
        at = some.at
        self._sums = []
        self._native.feed(
            (some.speed, some.volts, some.current, some.reported), some.temperature, some.command,
            (at.ran, at.t, at.step), (start, width),
        )  # fmt: skip

    def halve(self) -> None:
        """Make one slot of two."""
        self._sums = []
        self._native.halve()

    @property
    def count(self) -> Array:
        """Reports by kind, slot and bin."""
        return self._sum(0).reshape(BINNED, SLOTS, BINS)

    @property
    def total(self) -> Array:
        """What they say, added up, by kind, slot and bin."""
        return self._sum(1).reshape(BINNED, SLOTS, BINS)

    @property
    def first(self) -> Array:
        """Recorded time, and time, of the first report of each slot; `NEVER` without one."""
        return self._sum(4).reshape(2, SLOTS)

    def _sum(self, number: int) -> Array:
        if not self._sums:
            kinds = (np.float64, np.float64, np.float64, np.float64, np.int64)
            self._sums = [cells(column, kind) for column, kind in zip(self._native.sums(), kinds, strict=True)]
        return self._sums[number]

    def mean(self, name: str) -> tuple[Array, Array]:
        """Return how many reports each slot has of something in `MEASURED`, and their mean, NaN of none."""
        count, total = self._sum(2).reshape(len(MEASURED), 2, SLOTS)[MEASURED.index(name)]
        return count, _mean(count, total)

    def numbers(self, name: str) -> Array:
        """Return something in `COUNTED`, by slot."""
        found: Array = self._sum(3).reshape(len(COUNTED), SLOTS)[COUNTED.index(name)]
        return found


def _mean(count: Array, total: Array) -> Array:
    with np.errstate(divide="ignore", invalid="ignore"):
        found: Array = np.where(count > 0, total / count / ONE, np.nan)
    return found
