"""The reports of one ESC as sums by time and bin: whole numbers, so that any cut of a capture gives the same."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.flight.clock import ANEW
from analyzer.flight.motors.steady import SteadySpeed
from analyzer.flight.odd.quantities import BINNED, BINS, binned
from analyzer.flight.thresholds import threshold

if TYPE_CHECKING:
    from analyzer.flight.motors.reports import EscReports
    from dissectors.kit import Array
    from dissectors.picture import Plot

SLOTS = 128  # of time; when they are full, two become one
ONE = float(1 << 20)  # of anything that is measured, as a whole number
NEVER = np.iinfo(np.int64).max
_PERIODS = 32  # until one is known; one round of transfer IDs
MEASURED = ("temperature", "voltage", "power")  # sums by time alone
COUNTED = ("came", "lost", "late")


class EscCells:
    """Takes the reports of one device, in order. Bound: `SLOTS` by `BINS` sums of each kind.

    `count` and `total` are by kind, slot and bin; `measured` has count and total of `MEASURED` by slot, `counted` the
    numbers of `COUNTED`; `first` is recorded time, time and frame of the first report of a slot.
    """

    def __init__(self, plot: Plot, key: int) -> None:
        self.plot, self.key = plot, key
        self.count = np.zeros((BINNED, SLOTS, BINS))
        self.total = np.zeros((BINNED, SLOTS, BINS))
        self.measured = np.zeros((len(MEASURED), 2, SLOTS))
        self.counted = np.zeros((len(COUNTED), SLOTS))
        self.first = np.full((2, SLOTS), NEVER)
        self._steady = SteadySpeed()
        self._learned: list[int] = []
        self._late = 0  # ns after which a report is late, 0 while that is not known
        self._ran: int | None = None

    def feed(self, some: EscReports, on: Array, slot: Array) -> None:
        """Add the next reports, those `on` in which the motor turns, and the slot that each is in."""
        steady = self._steady.feed(self.plot, some) & on
        for kind, (rows, bins, values) in enumerate(binned(some, steady)):
            if len(rows):
                cell = slot[rows] * BINS + bins[rows]
                self.count[kind] += np.bincount(cell, minlength=SLOTS * BINS).reshape(SLOTS, BINS)
                whole = np.round(values[rows] * ONE)
                self.total[kind] += np.bincount(cell, whole, SLOTS * BINS).reshape(SLOTS, BINS)
        lost, late = self._missing(some)
        if not on.any():
            return
        calm = (steady | np.isnan(some.speed)) & (some.volts > 1)
        volts = np.log(np.where(calm, some.volts, np.nan))
        for place, values in enumerate((some.temperature, volts, some.volts * some.current)):
            rows = np.flatnonzero(on & np.isfinite(values))
            self.measured[place, 0] += np.bincount(slot[rows], minlength=SLOTS)
            self.measured[place, 1] += np.bincount(slot[rows], np.round(values[rows] * ONE), SLOTS)
        rows = np.flatnonzero(on)
        for place, numbers in enumerate((np.ones(len(rows)), lost[rows], late[rows])):
            self.counted[place] += np.bincount(slot[rows], numbers, SLOTS)
        which, begins = np.unique(slot[rows], return_index=True)
        fresh = self.first[0, which] == NEVER
        for place, times in enumerate((some.at.ran, some.at.t)):
            self.first[place, which[fresh]] = times[rows[begins[fresh]]]

    def halve(self) -> None:
        """Make one slot of two."""
        for name in ("count", "total"):
            old = getattr(self, name).reshape(BINNED, SLOTS // 2, 2, BINS).sum(axis=2)
            setattr(self, name, np.concatenate((old, np.zeros_like(old)), axis=1))
        for name in ("measured", "counted"):
            old = getattr(self, name)
            old = old.reshape(*old.shape[:-1], SLOTS // 2, 2).sum(axis=-1)
            setattr(self, name, np.concatenate((old, np.zeros_like(old)), axis=-1))
        even, uneven = self.first[:, ::2], self.first[:, 1::2]
        kept = np.where(even == NEVER, uneven, even)
        self.first = np.concatenate((kept, np.full_like(kept, NEVER)), axis=1)

    def mean(self, name: str) -> tuple[Array, Array]:
        """Return how many reports each slot has of something in `MEASURED`, and their mean, NaN of none."""
        count, total = self.measured[MEASURED.index(name)]
        return count, _mean(count, total)

    def numbers(self, name: str) -> Array:
        """Return something in `COUNTED`, by slot."""
        found: Array = self.counted[COUNTED.index(name)]
        return found

    def _missing(self, some: EscReports) -> tuple[Array, Array]:
        """Return how many reports are missing before each, and which come late although none is."""
        step, ran = some.at.step, some.at.ran
        lost = np.where((step > 1) & (step != ANEW), step - 1, 0)
        gaps = np.diff(ran, prepend=ran[0] if self._ran is None else self._ran)
        begin = 1 if self._ran is None else 0
        self._ran = int(ran[-1])
        known = 0
        if not self._late:
            fresh = gaps[begin : begin + _PERIODS - len(self._learned)].tolist()
            self._learned += fresh
            known = begin + len(fresh)
            if len(self._learned) >= _PERIODS:
                self._late = max(1, int(threshold("late_periods") * float(np.median(self._learned))))
        late = (gaps > self._late) & (step == 1) if self._late else np.zeros(len(gaps), bool)
        late[:known] = False
        return lost, late


def _mean(count: Array, total: Array) -> Array:
    with np.errstate(divide="ignore", invalid="ignore"):
        found: Array = np.where(count > 0, total / count / ONE, np.nan)
    return found
