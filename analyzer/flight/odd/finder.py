"""Adds up what all ESCs of a capture report, so that the odd one is found at the end."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.flight.odd.cells import SLOTS, EscCells
from analyzer.flight.odd.judge import OddReport, judged
from analyzer.flight.thresholds import lasting

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.flight.clock import RecordedClock
    from analyzer.flight.flights import Flight
    from analyzer.flight.motors.reports import EscReader

MOST_DEVICES = 64


class OddFinder:
    """Adds up batches: `feed()`, then `found(flights)`. Bound: `MOST_DEVICES`, and that of `EscCells` of each.

    Args:
        clock: of the capture, and
        reader: of the reports of each batch; both are fed before.
    """

    def __init__(self, clock: RecordedClock, reader: EscReader) -> None:
        self._clock, self._reader = clock, reader
        self._devices: dict[tuple[str, int], EscCells] = {}
        self._width = lasting("odd_slot")

    def feed(self) -> None:
        """Add the reports of the batch."""
        for plot, key, some in self._reader.now:
            device = self._devices.get((plot.table, key))
            if device is None:
                if len(self._devices) >= MOST_DEVICES:
                    continue
                device = self._devices[plot.table, key] = EscCells(plot, key)
            start = self._clock.start or 0
            while int(some.at.ran.max()) - start >= SLOTS * self._width:
                self._width *= 2
                for one in self._devices.values():
                    one.halve()
            device.feed(some, start, self._width)

    def found(self, flights: Sequence[Flight]) -> OddReport:
        """Return what is odd, after the last batch."""
        for one in self._devices.values():
            one.ch = self._reader.channel(one.plot, one.key)
        return judged(list(self._devices.values()), flights, self._width)
