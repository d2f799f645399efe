"""Message and packet tables, cut into the rows of one device each; `devices` draws those."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from analyzer.plot.definitions import Definitions
from analyzer.plot.devices import Devices, Rows
from analyzer.plot.moments import Moments, times
from analyzer.plot.readings import Readings
from analyzer.plot.units import Units
from analyzer.tables import numbers, valid
from dissectors import picture

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator, Mapping

    from analyzer.plot.canvas import Canvas
    from dissectors import Registry
    from dissectors.conformance import Words
    from dissectors.picture import Plot

_NUMBERS = 32  # bits of a device's number in a key
_MOST_NUMBER = 1 << 20


class Messages:
    """Draws the tables of one capture, batch by batch.

    Args:
        canvas: takes the points.
        registry: the types that the capture is decoded with. Raises `ProfileError` for a wrong `plots.toml`.
        forced: choices of readings by node ID that stand against any evidence.
    """

    def __init__(self, canvas: Canvas, registry: Registry, forced: Mapping[int, Collection[str]]) -> None:
        self.pictures = picture.load(registry.profiles)
        self._canvas = canvas
        self._definitions = Definitions(registry)
        self._devices = Devices(canvas, self.pictures)
        self._units = Units()
        self._readings: dict[str, Readings] = {}
        for name, plot in self.pictures.plots.items():
            asked = any(line.only for line in plot.lines) or any(states.only for states in plot.states)
            message = self._definitions.message(name) if asked else None
            if message is not None:
                self._readings[name] = Readings(message, forced)

    def add(
        self, tables: Mapping[str, pa.RecordBatch], lead: Callable[[Words], Words], buses: tuple[str, ...]
    ) -> None:  # fmt: skip
        """The tables of a batch; `lead` gives the numbers of the first frames of transfers, from 1."""
        for readings in self._readings.values():
            readings.look(tables)
        for name, table in tables.items():
            plot = self.pictures.plots.get(name) or picture.Plot(name)
            for piece, bus, node, number in _pieces(_usable(table), plot):
                unit = self._units.unit(name, plot.who, bus, node, number, buses[bus])
                if unit is None:
                    self._canvas.inventory.beyond += 1
                    continue
                moments = Moments(times(piece.column("t")), lead(numbers(piece.column("transfer"))))
                rows = Rows(piece, moments, self._definitions.of(name), unit, (bus, node, buses[bus]))
                self._devices.draw(plot, rows, self._readings.get(name), self._units)


def _usable(table: pa.RecordBatch) -> pa.RecordBatch:
    """Rows whose transfers, and packets, are whole."""
    rows = numbers(table.column("trusted"))
    if "packet_ok" in table.schema.names:
        rows = rows & numbers(table.column("packet_ok"))
    return table if rows.all() else table.filter(pa.array(rows))


def _pieces(table: pa.RecordBatch, plot: Plot) -> Iterator[tuple[pa.RecordBatch, int, int, int]]:
    """The rows of each device in their order, with its bus, node and number; devices in the order of appearance."""
    key = numbers(table.column("bus")).astype(np.int64) << 8 | numbers(table.column("src"))
    if plot.who.column:
        if plot.who.column not in table.schema.names:
            return
        column = table.column(plot.who.column)
        if column.null_count:
            has = valid(column)
            table, key, column = table.filter(pa.array(has)), key[has], column.filter(pa.array(has))
        number = np.clip(np.nan_to_num(numbers(column)), 0, _MOST_NUMBER).astype(np.int64)
        key = key << _NUMBERS | number
    else:
        key = key << _NUMBERS
    if not len(key):
        return
    if (key[0] == key).all():
        yield table, *_split(int(key[0]))
        return
    order = np.argsort(key, kind="stable")
    ordered = key[order]
    table = table.take(pa.array(order))
    starts = [0, *(np.flatnonzero(np.diff(ordered)) + 1).tolist()]
    ends = [*starts[1:], len(ordered)]
    for _, start, end in sorted((int(order[start]), start, end) for start, end in zip(starts, ends, strict=True)):
        yield table.slice(start, end - start), *_split(int(ordered[start]))


def _split(key: int) -> tuple[int, int, int]:
    return key >> _NUMBERS + 8, key >> _NUMBERS & 0xFF, key & (1 << _NUMBERS) - 1
