"""Power-ups by a device's own counter of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.devices.rows import split
from analyzer.flight.log import FlightEvent
from analyzer.flight.reports import ReportEvents
from analyzer.flight.thresholds import lasting
from dissectors.kit.cells import numbers
from dissectors.kit.order import changes
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.decode.engine import Batch
    from analyzer.flight.clock import RowPlaces, Spot
    from analyzer.flight.reports import EventOrder
    from analyzer.flight.tables import ReportTable
    from dissectors.kit import Array
    from dissectors.picture import Plot

MOST_DEVICES = 1024


class PowerUpEvents(ReportEvents):
    """Adds up batches; bound: `MOST_DEVICES`."""

    @staticmethod
    def of_use(plot: Plot) -> bool:
        """Return whether it counts power-ups."""
        return bool(plot.starts)

    def __init__(self, order: EventOrder) -> None:
        super().__init__(order)
        self._last: dict[tuple[object, ...], tuple[int, Spot]] = {}  # the last count of a device, and where it was

    def feed(self, batch: Batch) -> None:
        """Add the next batch."""
        for plot in self._plots:
            if (read := self._reader.table(plot, batch)) is not None:
                self._note_starts(read)

    def finish(self) -> None:
        """Take the end: everything has been told."""

    def _note_starts(self, read: ReportTable) -> None:
        """Take counters; where a table tells the hardware by its identity, that has the counter."""
        plot, table, counter = read.plot, read.table, read.column(read.plot.starts)
        if counter is None:
            return
        identity = numbers(table.column(plot.identity))[read.order] if plot.identity in table.schema.names else None
        counts, has = counter.values[read.order], None if counter.has is None else counter.has[read.order]
        for key, places, _ in read.devices:
            rows = np.arange(places.start, places.stop)
            rows = rows if has is None else rows[has[places]]
            pieces = [(None, rows)] if identity is None else _by_value(identity, rows)
            for which, mine in pieces:
                if len(mine):
                    self._count(plot, (plot.table, key, which), counts[mine], read.at.take(mine))

    def _count(self, plot: Plot, device: tuple[str, int, object], counts: Array, at: RowPlaces) -> None:
        """Tell where a counter goes on, by no more than there was time for."""
        known = self._last.get(device)
        if known is None and len(self._last) >= MOST_DEVICES:
            return
        first, since = known or (int(counts[0]), at.at(0))
        for k in changes(counts, first).tolist():
            spot, last, new = at.at(k - 1) if k else since, int(counts[k - 1]) if k else first, int(counts[k])
            room = (at.t[k] - spot.t + lasting("power_up_slack")) // SECOND
            if 0 < new - last <= room:
                often = "again" if new - last == 1 else f"{new - last} times"
                text = f"was powered up {often}: {plot.starts} {last} -> {new}"
                bus, node, number = split(device[1])
                ch = number + plot.who.first if plot.who.column and plot.esc.rpm else None
                self._add(FlightEvent(
                    "power-up", text, spot, at.at(k), None, bus, node, ch, plot.table, "", {plot.starts: float(new)}
                ))  # fmt: skip
        self._last[device] = int(counts[-1]), at.at(-1)


def _by_value(values: Array, rows: Array) -> Iterator[tuple[object, Array]]:
    for value in np.unique(values[rows]).tolist():
        yield value, rows[values[rows] == value]
