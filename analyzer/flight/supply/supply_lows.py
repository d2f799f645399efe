"""The lowest voltages of battery monitors and other supplies that are no ESC's, by stretches of the recording."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.devices.rows import split
from analyzer.flight.reports import ReportEvents
from dissectors.times import SECOND

if TYPE_CHECKING:
    from analyzer.decode.engine import Batch
    from analyzer.flight.reports import EventOrder
    from dissectors.kit import Array
    from dissectors.picture import Plot

STEP = SECOND
MOST_STEPS = 1 << 17  # 36 hours
MOST_DEVICES = 64
_VOLTAGE = "voltage"


class SupplyLows(ReportEvents):
    """Adds up batches. Bounds: `MOST_DEVICES`, the first `MOST_STEPS` of each."""

    def __init__(self, order: EventOrder) -> None:
        super().__init__(order)
        self._lows: dict[int, dict[int, float]] = {}

    @staticmethod
    def of_use(plot: Plot) -> bool:
        """Return whether it tells a voltage, and is no report of an ESC."""
        return not plot.esc.rpm and not plot.who.elements and any(line.quantity == _VOLTAGE for line in plot.lines)

    def feed(self, batch: Batch) -> None:
        """Add the next batch."""
        for plot in self._plots:
            if (read := self._reader.table(plot, batch)) is None:
                continue
            column = next(line.column for line in plot.lines if line.quantity == _VOLTAGE)
            volts = read.numbers(column)
            good = np.isfinite(volts)
            for key, rows, at in read.devices:
                if key in self._lows or len(self._lows) < MOST_DEVICES:
                    mine = good[rows]
                    self._note(self._lows.setdefault(key, {}), at.ran[mine], volts[rows][mine])

    def finish(self) -> None:
        """Take the end: everything is known."""

    def _note(self, lows: dict[int, float], ran: Array, volts: Array) -> None:
        if not len(ran):
            return
        steps = (ran - (self._clock.start or 0)) // STEP
        starts = np.flatnonzero(np.diff(steps, prepend=steps[0] - 1))
        for step, lowest in zip(steps[starts].tolist(), np.minimum.reduceat(volts, starts).tolist(), strict=True):
            if step in lows or len(lows) < MOST_STEPS:
                lows[step] = min(lows.get(step, np.inf), lowest)

    def lowest(self, start: int, stop: int) -> dict[tuple[int, int], float]:
        """Return the lowest voltage of each bus and node in whole steps of a recorded time."""
        base = self._clock.start or 0
        first, last = (start - base) // STEP, (stop - base) // STEP
        found: dict[tuple[int, int], float] = {}
        for key, lows in self._lows.items():
            bus, node, _ = split(key)
            if mine := [volts for step, volts in lows.items() if first <= step <= last]:
                found[bus, node] = min(found.get((bus, node), np.inf), *mine)
        return found
