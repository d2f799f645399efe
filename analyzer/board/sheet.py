"""One table of devices: the last value of each quantity, the lowest and the highest, states, and how often it comes."""

from __future__ import annotations

from itertools import islice
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pyarrow as pa

from analyzer.board.groups import NONE, Groups, LongestGaps, Slots
from analyzer.board.words import StateWord
from analyzer.devices import fields
from analyzer.devices.readings import holding
from analyzer.devices.rows import keyed, split, usable
from dissectors.kit import SECOND
from dissectors.kit.cells import numbers, valid

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.devices.units import Unit, Units
    from dissectors.kit import Array
    from dissectors.only import Only
    from dissectors.picture import Line, Plot
    from dissectors.schema import Message, Packet

MOST_DEVICES = 256  # of one table
_STALE, _PERIODS = SECOND, 4  # a device is stale after both a second and four of its usual periods


class Spoken(NamedTuple):
    """One device in one table: who speaks of it, how often, and the longest pause since the mark with its end."""

    place: int
    unit: Unit
    bus: int
    node: int
    t: int
    gap: tuple[int, int]
    rows: int
    patience: int

    def stale(self, now: int) -> bool:
        """Return True if nothing was heard for longer than usual."""
        return now - self.t > self.patience


class DeviceSheet:
    """The devices that the rows of one table speak of; the first `MOST_DEVICES`.

    Args:
        plot: which columns are quantities, and whose.
        of: what the columns mean.
        lines: the quantities that are followed.
    """

    def __init__(self, plot: Plot, of: Message | Packet | None, lines: tuple[Line, ...]) -> None:
        self.plot, self.lines = plot, lines
        self.whole = [True] * len(lines)
        notes = {} if of is None else of.notes
        self.words = [(StateWord(one.column, notes.get(one.column), MOST_DEVICES), one.only) for one in plot.states]
        self._of = of
        self._slots = Slots(MOST_DEVICES)
        self._units: list[Unit | None] = []
        self.last, self.low, self.high = (np.full((len(lines), MOST_DEVICES + 1), np.nan) for _ in range(3))
        self._t, self._first = (np.full(MOST_DEVICES + 1, NONE, np.int64) for _ in range(2))
        self._gaps = LongestGaps(MOST_DEVICES + 1)
        self._count = np.zeros(MOST_DEVICES + 1, np.int64)

    @property
    def reports(self) -> bool:
        """True if devices speak here of themselves; else somebody speaks to them."""
        return not self.plot.who.elements

    @property
    def beyond(self) -> int:
        """Devices that found no place."""
        return self._slots.beyond

    def feed(self, table: pa.RecordBatch, units: Units, buses: tuple[str, ...]) -> None:
        """Take the rows of a batch."""
        table = usable(table)
        if table.column("t").null_count:
            table = table.filter(pa.array(valid(table.column("t"))))
        table, keys = keyed(table, self.plot.who)
        if not len(keys):
            return
        t = numbers(table.column("t"))
        if self.plot.who.elements:
            keys, t, values = self._elements(table, keys, t)
        else:
            values = self._values(table)
        if not len(keys):
            return
        groups = Groups(keys)
        places = self._slots.find(groups)
        self._name(units, buses)
        self._take(groups, places, values)
        self._gaps.feed(groups, places, t, self._t[places])
        new = self._first[places] == NONE
        if new.any():
            self._first[places[new]] = t[groups.order[groups.starts]][new]
        self._t[places] = groups.last(t)
        self._count[places] += groups.ends - groups.starts
        for word, only in self.words:
            self._state(word, only, table, (keys, groups, places, t))

    def _values(self, table: pa.RecordBatch) -> Array:
        """Return numbers by line and row; NaN for those that are missing."""
        found = np.full((len(self.lines), len(table)), np.nan)
        for k, line in enumerate(self.lines):
            for column in fields.column(self._of, table, line.column)[:1]:
                has = _both(column.has, holding(line.only, table))
                if has is None:
                    found[k] = column.values
                else:
                    found[k, has] = column.values[has]
                self.whole[k] = column.values.dtype.kind != "f"
        return found

    def _elements(self, table: pa.RecordBatch, keys: Array, t: Array) -> tuple[Array, Array, Array]:
        """Return keys, times and values of all elements of the lists in a table; only the first line is followed."""
        found = fields.elements(self._of, table, self.lines[0].column) if self.lines else None
        if found is None:
            return keys[:0], t[:0], np.empty((len(self.lines), 0))
        row, place, column = found
        self.whole[0] = column.values.dtype.kind != "f"
        values = np.full((len(self.lines), len(row)), np.nan)
        values[0] = column.values
        if column.has is not None and not column.has.all():
            row, place, values = row[column.has], place[column.has], values[:, column.has]
        return keys[row] | place, t[row], values

    def _take(self, groups: Groups, places: Array, values: Array) -> None:
        if not len(values):
            return
        ordered = values[:, groups.order]
        missing = ~np.isfinite(ordered)
        if missing.any():
            ordered[missing] = np.nan
            at = np.where(missing, NONE, np.arange(ordered.shape[1]))
            at = np.maximum.reduceat(at, groups.starts, axis=1)
            last = np.where(at == NONE, self.last[:, places], np.take_along_axis(ordered, np.maximum(at, 0), 1))
        else:
            last = ordered[:, groups.ends - 1]
        self.last[:, places] = last
        self.low[:, places] = np.fmin(self.low[:, places], np.fmin.reduceat(ordered, groups.starts, axis=1))
        self.high[:, places] = np.fmax(self.high[:, places], np.fmax.reduceat(ordered, groups.starts, axis=1))

    def _state(
        self, word: StateWord, only: Only | None, table: pa.RecordBatch, of: tuple[Array, Groups, Array, Array]
    ) -> None:  # fmt: skip
        if self.plot.who.elements or word.column not in table.schema.names:
            return
        keys, groups, places, t = of
        array = table.column(word.column)
        if not (pa.types.is_integer(array.type) or pa.types.is_boolean(array.type)):
            return
        codes = numbers(array).astype(np.int64)
        has = _both(valid(array) if array.null_count else None, holding(only, table))
        if has is not None:
            if not has.any():
                return
            groups, codes, t = Groups(keys[has]), codes[has], t[has]
            places = self._slots.find(groups)
        word.feed(groups, places, codes, t)

    def _name(self, units: Units, buses: tuple[str, ...]) -> None:
        for key in islice(self._slots.of, len(self._units), None):
            bus, node, number = split(key)
            self._units.append(units.unit(self.plot.table, self.plot.who, bus, node, number, buses[bus]))

    def mark(self) -> None:
        """Let the lowest, the highest and the longest count anew."""
        self.low[:] = self.high[:] = np.nan
        self._gaps.clear()
        for word, _ in self.words:
            word.mark()

    def spoken(self) -> Iterator[Spoken]:
        """Give every device that has a name."""
        for (key, place), unit in zip(self._slots.of.items(), self._units, strict=True):
            if unit is not None:
                bus, node, _ = split(key)
                t, count = int(self._t[place]), int(self._count[place])
                period = (t - int(self._first[place])) // (count - 1) if count > 1 else 0
                patience = max(_STALE, _PERIODS * period)
                yield Spoken(place, unit, bus, node, t, self._gaps.at(place), count, patience)


def _both(one: Array | None, other: Array | None) -> Array | None:
    if one is None or other is None:
        return other if one is None else one
    return one & other
