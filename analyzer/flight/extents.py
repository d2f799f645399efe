"""ESCs that reported: how often, from when to when, and between which voltages, temperatures and speeds."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.devices.rows import split
from analyzer.flight.reports import ReportEvents
from dissectors.records import dataclass, field

if TYPE_CHECKING:
    from analyzer.decode.engine import Batch
    from analyzer.flight.reports import EventOrder
    from dissectors.kit import Array
    from dissectors.picture import Plot

MOST_DEVICES = 1024
QUANTITIES = ("rpm", "voltage", "current", "temperature")


@dataclass(slots=True)
class EscExtent:
    """The reports of one device in a table: `ch` as people count, None if it has no number.

    `first` and `last` are recorded times, `ranges` the least and the most by quantity.
    """

    table: str
    bus: int
    node: int
    ch: int | None
    first: int
    last: int
    count: int = 0
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict)

    def note(self, name: str, values: Array) -> None:
        """Take what was measured."""
        good = values if np.isfinite(values).all() else values[np.isfinite(values)]
        if len(good):
            low, high = float(good.min()), float(good.max())
            known = self.ranges.get(name, (low, high))
            self.ranges[name] = min(known[0], low), max(known[1], high)


class EscExtents(ReportEvents):
    """Adds up batches; bound: `MOST_DEVICES`."""

    def __init__(self, order: EventOrder) -> None:
        super().__init__(order)
        self._all: dict[tuple[str, int], EscExtent] = {}

    @staticmethod
    def of_use(plot: Plot) -> bool:
        """Return whether it tells speeds."""
        return bool(plot.esc.rpm)

    def feed(self, batch: Batch) -> None:
        """Add the next batch."""
        for plot in self._plots:
            if (table := self._reader.table(plot, batch)) is None:
                continue
            columns = {name: table.numbers(column) for name in QUANTITIES if (column := getattr(plot.esc, name))}
            timed = table.timed
            whole = bool(timed.all())
            for key, places, at in table.devices:
                rows, mine = (places, at) if whole else (places[timed[places]], at.take(timed[places]))
                one = self._of(plot, key, mine.at(0).ran) if len(rows) else None
                if one is None:
                    continue
                one.count += len(rows)
                one.last = mine.at(-1).ran
                for name, values in columns.items():
                    one.note(name, values[rows])

    def finish(self) -> None:
        """Take the end: everything is known."""

    def _of(self, plot: Plot, key: int, ran: int) -> EscExtent | None:
        known = self._all.get((plot.table, key))
        if known is None and len(self._all) < MOST_DEVICES:
            bus, node, number = split(key)
            ch = number + plot.who.first if plot.who.column and plot.who.first else None
            known = self._all[plot.table, key] = EscExtent(plot.table, bus, node, ch, ran, ran)
        return known

    @property
    def all(self) -> list[EscExtent]:
        """All of them, in the order in which they came."""
        return list(self._all.values())
