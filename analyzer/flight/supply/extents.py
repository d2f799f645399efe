"""ESCs that reported: how often, from when to when, and between which voltages, temperatures and speeds."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.devices.readings import holding
from analyzer.devices.rows import split
from analyzer.flight.reports import ReportEvents
from analyzer.flight.thresholds import idle_rpm
from dissectors.records import dataclass, field

if TYPE_CHECKING:
    import pyarrow as pa

    from analyzer.decode.engine import Batch
    from analyzer.flight.reports import EventOrder
    from dissectors.kit import Array
    from dissectors.picture import Plot, States

MOST_DEVICES = 1024
MOST_WAYS = 256  # changes of direction that are kept
QUANTITIES = ("rpm", "voltage", "current", "temperature")


@dataclass(slots=True)
class EscExtent:
    """The reports of one device in a table: `ch` as people count, None if it has no number.

    `first` and `last` are recorded times, `ranges` the least and the most by quantity. `ways` are the times at which it
    was first seen to turn forwards or backwards, or the other way than before. `modes` is whether it tells
    modes or fault bits.
    """

    table: str
    bus: int
    node: int
    ch: int | None
    first: int
    last: int
    count: int = 0
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict)
    ways: list[tuple[int, bool]] = field(default_factory=list)
    modes: bool = False

    def forwards(self, until: int) -> bool | None:
        """Return which way it turned last, up to a recorded time; None if it did not turn."""
        return next((way for ran, way in reversed(self.ways) if ran <= until), None)

    def turn(self, rpm: Array, ran: Array) -> None:
        """Take speeds of a motor that turns, negative for backwards, and when it was."""
        way = rpm > 0
        last = not way[0] if not self.ways else self.ways[-1][1]
        for k in np.flatnonzero(np.diff(way, prepend=last)).tolist():
            if len(self.ways) < MOST_WAYS:
                self.ways.append((int(ran[k]), bool(way[k])))

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
            for key, rows, at in table.devices:
                one = self._of(plot, key, at.at(0).ran)
                if one is None:
                    continue
                one.count += len(at)
                one.last = at.at(-1).ran
                for name, values in columns.items():
                    one.note(name, values[rows])
                if "rpm" in columns:
                    rpm = columns["rpm"][rows]
                    fast = np.flatnonzero(np.abs(rpm) > idle_rpm(plot))
                    if len(fast):
                        one.turn(rpm[fast], at.ran[fast])
                if not one.modes:
                    one.modes = any(_tells(states, table.table, table.order[rows]) for states in plot.states)

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


def _tells(states: States, table: pa.RecordBatch, rows: Array) -> bool:
    """Return whether some rows tell a trouble, as their node reads its fields."""
    told = holding(states.only, table) if states.signs else np.zeros(len(table), bool)
    return told is None or bool(told[rows].any())
