"""The reports of one ESC as sums by time and bin: whole numbers, so that any cut of a capture gives the same."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer import _native
from analyzer.decode.sent import cells
from analyzer.flight.thresholds import idle_rpm, lasting, threshold

if TYPE_CHECKING:
    from collections.abc import Mapping

    from analyzer.flight.motors.reports import EscReports
    from dissectors.kit import Array
    from dissectors.picture import Plot

SLOTS = 128  # of time; when they are full, two become one
BINS = 40
ONE = float(1 << 20)  # of anything that is measured, as a whole number
NEVER = np.iinfo(np.int64).max
MEASURED = ("temperature", "voltage", "power")  # sums by time alone
COUNTED = ("came", "lost", "late")


class EscCells:
    """Takes the reports of one device, in order. Bound: `SLOTS` by `BINS` sums of each kind.

    Kinds of `count` and `total` are the numbers of quantities. `ch` is its channel as people count, None if unknown.
    """

    def __init__(self, plot: Plot, key: int) -> None:
        self.plot, self.key = plot, key
        self.ch: int | None = None
        self._native = _native.MotorSums(_limits(plot))
        self._bins: tuple[Array, Array] | None = None
        self._slots: tuple[Array, Array, Array] | None = None

    def feed(self, some: EscReports, start: int, width: int) -> None:
        """Add the next reports, in slots of `width` ns from `start` on."""
        self._bins = self._slots = None
        self._native.feed(some.rows, some.part.start, some.part.stop, start, width)

    def halve(self) -> None:
        """Make one slot of two."""
        self._bins = self._slots = None
        self._native.halve()

    @property
    def count(self) -> Array:
        """How many reports there are of each kind, by slot and bin."""
        return self._binned()[0]

    @property
    def total(self) -> Array:
        """Their sums, in parts of `ONE`."""
        return self._binned()[1]

    @property
    def first(self) -> Array:
        """The recorded time and the time of the first report of each slot, `NEVER` for none."""
        return self._by_slot()[2]

    def mean(self, name: str) -> tuple[Array, Array]:
        """Return how many reports each slot has of something in `MEASURED`, and their mean, NaN of none."""
        count, total = self._by_slot()[0][MEASURED.index(name)]
        with np.errstate(divide="ignore", invalid="ignore"):
            found: Array = np.where(count > 0, total / count / ONE, np.nan)
        return count, found

    def numbers(self, name: str) -> Array:
        """Return something in `COUNTED`, by slot."""
        found: Array = self._by_slot()[1][COUNTED.index(name)]
        return found

    def _binned(self) -> tuple[Array, Array]:
        if self._bins is None:
            count, total = (cells(one, np.float64).reshape(-1, SLOTS, BINS) for one in self._native.bins())
            self._bins = count, total
        return self._bins

    def _by_slot(self) -> tuple[Array, Array, Array]:
        if self._slots is None:
            measured, counted, first = self._native.slots()
            self._slots = (
                cells(measured, np.float64).reshape(len(MEASURED), 2, SLOTS),
                cells(counted, np.float64).reshape(len(COUNTED), SLOTS),
                cells(first, np.int64).reshape(2, SLOTS),
            )
        return self._slots


def _limits(plot: Plot) -> Mapping[str, float]:
    return {
        "idle_rpm": idle_rpm(plot),
        "idle_percent": threshold("command_idle_percent"),
        "least_a": threshold("motor_least_a"),
        "steady_percent": threshold("motor_steady_percent"),
        "steady_speed": threshold("steady_speed"),
        "pause": lasting("silent_motor"),
        "late_periods": threshold("late_periods"),
    }
