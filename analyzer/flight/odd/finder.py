"""Adds up what all ESCs of a capture report, so that the odd one is found at the end."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.flight.clock import RecordedClock
from analyzer.flight.motors.reports import EscReader
from analyzer.flight.motors.steady import turning
from analyzer.flight.odd.cells import SLOTS, EscCells
from analyzer.flight.odd.judge import OddReport, judged
from analyzer.flight.orders import CommandReader
from analyzer.flight.reports import EventOrder
from analyzer.flight.tables import ReportReader
from analyzer.flight.thresholds import lasting
from dissectors import picture

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.decode.engine import Batch
    from analyzer.flight.flights import Flight
    from dissectors import Registry

MOST_DEVICES = 64


class OddFinder:
    """Adds up batches: `feed(batch)`, then `found(flights)`. Bound: `MOST_DEVICES`, and that of `EscCells` of each.

    Args:
        registry: the types. Raises `ProfileError` for a wrong `plots.toml`.
        clock: of the capture, and
        reader: of the reports of each batch, if somebody else feeds them before.
    """

    def __init__(self, registry: Registry, clock: RecordedClock | None = None, reader: EscReader | None = None) -> None:
        self._clock = RecordedClock() if clock is None else clock
        self._commands: CommandReader | None = None
        if reader is None:
            plots = tuple(picture.load(registry).plots.values())
            self._commands = CommandReader(registry, plots, self._clock)
            order = EventOrder(registry, plots, self._clock, lambda _: None, ReportReader(registry, self._clock))
            reader = EscReader(order, self._commands)
        self._reader = reader
        self._devices: dict[tuple[str, int], EscCells] = {}
        self._width = lasting("odd_slot")

    def feed(self, batch: Batch) -> None:
        """Add the next batch."""
        if self._commands is not None:
            self._clock.feed(batch)
            self._commands.feed(batch)
            self._reader.feed(batch)
        for plot, key, some in self._reader.now:
            device = self._devices.get((plot.table, key))
            if device is None:
                if len(self._devices) >= MOST_DEVICES:
                    continue
                device = self._devices[plot.table, key] = EscCells(plot, key)
            since = np.maximum(some.at.ran - (self._clock.start or 0), 0)
            while int(since.max()) // self._width >= SLOTS:
                self._width *= 2
                for one in self._devices.values():
                    one.halve()
            device.feed(some, turning(plot, some), since // self._width)

    def found(self, flights: Sequence[Flight]) -> OddReport:
        """Return what is odd, after the last batch."""
        return judged(list(self._devices.values()), flights, self._width)
