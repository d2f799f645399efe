"""ESCs that reported: how often, from when to when, and between which voltages, temperatures and speeds."""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING

import numpy as np

from analyzer.devices.readings import holding
from analyzer.devices.rows import split
from analyzer.flight.motors.halves import supply_alone
from analyzer.flight.reports import ReportEvents
from analyzer.flight.thresholds import idle_rpm
from dissectors.records import dataclass, field, replace

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pyarrow as pa

    from analyzer.decode.engine import Batch
    from analyzer.flight.reports import EventOrder
    from analyzer.flight.tables import ReportTable
    from dissectors.kit import Array
    from dissectors.picture import Plot, States

MOST_DEVICES = 1024
MOST_WAYS = 256  # changes of direction that are kept
Ranges = dict[str, tuple[float, float]]  # the least and the most by quantity
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
    ranges: Ranges = field(default_factory=dict)
    ways: list[tuple[int, bool]] = field(default_factory=list)
    modes: bool = False

    def forwards(self, until: int) -> bool | None:
        """Return which way it turned last, up to a recorded time; None if it did not turn."""
        return next((way for ran, way in reversed(self.ways) if ran <= until), None)

    def goes_on(self, low: float, high: float, idle: float) -> bool:
        """Return whether speeds between these say nothing new: it stands, or turns the way that it did."""
        if low >= -idle and high <= idle:
            return True
        return bool(self.ways) and (low > idle if self.ways[-1][1] else high < -idle)

    def turn(self, rpm: Array, ran: Array, idle: float) -> None:
        """Take speeds, negative for backwards, and when it was."""
        fast = np.flatnonzero(np.abs(rpm) > idle)
        if not len(fast):
            return
        way, ran = rpm[fast] > 0, ran[fast]
        last = not way[0] if not self.ways else self.ways[-1][1]
        for k in np.flatnonzero(np.diff(way, prepend=last)).tolist():
            if len(self.ways) < MOST_WAYS:
                self.ways.append((int(ran[k]), bool(way[k])))


def _note(ranges: Ranges, name: str, table: ReportTable, column: str, place: int) -> None:
    """Take the least and the most that was measured by the device at a place of `devices`."""
    low, high = (extreme[place] for extreme in table.extremes(column))
    if not (isfinite(low) and isfinite(high)):
        values = table.numbers(column)[table.devices[place][1]]
        values = values[np.isfinite(values)]
        if not len(values):
            return
        low, high = float(values.min()), float(values.max())
    known = ranges.get(name, (low, high))
    ranges[name] = min(known[0], low), max(known[1], high)


class EscExtents(ReportEvents):
    """Adds up batches; bound: `MOST_DEVICES`."""

    def __init__(self, order: EventOrder) -> None:
        super().__init__(order)
        self._channels = order.channels
        self._all: dict[tuple[str, int], EscExtent] = {}
        self._supplies: dict[int, Ranges] = {}  # of ESCs that tell them in a message without speeds

    @staticmethod
    def of_use(plot: Plot) -> bool:
        """Return whether it tells speeds, or the supply of those who tell them otherwise."""
        return bool(plot.esc.rpm) or supply_alone(plot)

    def feed(self, batch: Batch) -> None:
        """Add the next batch."""
        for plot in self._plots:
            if (table := self._reader.table(plot, batch)) is None:
                continue
            columns = {name: column for name in QUANTITIES if (column := getattr(plot.esc, name))}
            if supply_alone(plot):
                self._note_supplies(table, columns)
            else:
                self._note_escs(table, columns)

    def finish(self) -> None:
        """Take the end: everything is known."""

    def _note_escs(self, table: ReportTable, columns: Mapping[str, str]) -> None:
        idle, speeds = idle_rpm(table.plot), columns["rpm"]
        for place, (key, rows, at) in enumerate(table.devices):
            one = self._of(table.plot, key, at.at(0).ran)
            if one is None:
                continue
            one.count += len(at)
            one.last = at.at(-1).ran
            low, high = (extreme[place] for extreme in table.extremes(speeds))
            if not one.goes_on(low, high, idle):
                one.turn(table.numbers(speeds)[rows], at.ran, idle)
            for name, column in columns.items():
                _note(one.ranges, name, table, column, place)
            if not one.modes:
                one.modes = any(_tells(states, table.table, table.order[rows]) for states in table.plot.states)

    def _note_supplies(self, table: ReportTable, columns: Mapping[str, str]) -> None:
        for place, (key, _, _) in enumerate(table.devices):
            if key in self._supplies or len(self._supplies) < MOST_DEVICES:
                mine = self._supplies.setdefault(key, {})
                for name, column in columns.items():
                    _note(mine, name, table, column, place)

    def _whole(self, key: tuple[str, int], one: EscExtent) -> EscExtent:
        """Return an ESC with what it tells of itself elsewhere: its supply, and its channel if it has no number."""
        ch = self._channels.of(one.bus, one.node) if one.ch is None else one.ch
        return replace(one, ch=ch, ranges=self._supplies.get(key[1], {}) | one.ranges)

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
        return [self._whole(key, one) for key, one in self._all.items()]


def _tells(states: States, table: pa.RecordBatch, rows: Array) -> bool:
    """Return whether some rows tell a trouble, as their node reads its fields."""
    told = holding(states.only, table) if states.signs else np.zeros(len(table), bool)
    return told is None or bool(told[rows].any())
