"""The rows of one device in one table: its lines, what is computed from them, its states, and every other field."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pyarrow as pa

from analyzer.devices import fields
from analyzer.devices.readings import holding
from analyzer.plot.chunks import path
from analyzer.plot.derived import Integrals, RowPeriods
from analyzer.plot.inventory import Series
from analyzer.plot.lanes import Lanes, names
from dissectors.kit.cells import numbers

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.devices.units import Unit, Units
    from analyzer.plot.canvas import Canvas, Column
    from analyzer.plot.moments import Moments
    from dissectors.kit import Array
    from dissectors.picture import Line, Pictures, Plot
    from dissectors.schema import Message, Packet

MESSAGES, STATES = "messages", "states"


class DeviceRows(NamedTuple):
    """Rows of a table that belong to one device; `sender` is bus, node and the name of the interface."""

    table: pa.RecordBatch
    moments: Moments
    of: Message | Packet | None
    unit: Unit
    sender: tuple[int, int, str]


class DevicePlots:
    """Draws devices, and remembers what their next rows go on from."""

    def __init__(self, canvas: Canvas, pictures: Pictures) -> None:
        self._canvas = canvas
        self._pictures = pictures
        self._lanes = Lanes()
        self._integrals = Integrals()
        self._periods = RowPeriods()

    def draw(self, plot: Plot, rows: DeviceRows, units: Units) -> None:
        """Draw rows of one device."""
        lines = [found for line in plot.lines for found in self._line(plot, line, rows, units)]
        lines += self._computed(plot, rows, lines)
        shown = {line.column for line in plot.lines} | plot.hidden
        for states in plot.states:
            shown |= {name for name in rows.table.schema.names if name.startswith(f"{states.column}.")} | {
                states.column
            }
            has = holding(states.only, rows.table)
            if has is not None and not has.any():
                continue
            if self._unchanged(plot, states.column, rows, has):
                continue
            for column in _word(rows, states.column):
                if column.kind != "number":
                    self._states((STATES, column.name[-1].removeprefix(f"{states.column}.")), column, rows, has)
        lines += self._others(plot, rows, frozenset(shown))
        self._canvas.lines(lines, rows.moments)

    def _line(self, plot: Plot, line: Line, rows: DeviceRows, units: Units) -> Iterator[Column]:
        has = holding(line.only, rows.table)
        if has is not None and not has.any():
            return
        for place, column in enumerate(fields.column(rows.of, rows.table, line.column)):
            unit: Unit | None = rows.unit
            if plot.who.elements:
                bus, node, name = rows.sender
                unit = units.unit(plot.table, plot.who, bus, node, place, name)
            if unit is None:
                continue
            yield self._series(line.quantity, line.role, unit), column.values, _both(column.has, has)

    def _computed(self, plot: Plot, rows: DeviceRows, lines: list[Column]) -> Iterator[Column]:
        known = {series.quantity: (values, has) for series, values, has in lines}
        for product in plot.products:
            first, second = (known.get(name) for name in product.factors)
            if first is not None and second is not None:
                values = first[0].astype(np.float64) * second[0]
                known[product.quantity] = values, _both(first[1], second[1])
                yield self._series(product.quantity, "", rows.unit), *known[product.quantity]
        for integral in plot.integrals:
            if integral.of in known:
                values, has = known[integral.of]
                values = values if has is None else np.where(has, values, np.nan)
                series = self._series(integral.quantity, "", rows.unit)
                found = self._integrals.add(series.path, rows.moments.t, values, integral.scale)
                yield series, found, ~np.isnan(found)
        if plot.intervals:
            bus, node, _ = rows.sender
            both = self._periods.add(f"{plot.table} {bus} {node}", rows.moments.t)
            for interval in plot.intervals:
                found = both[interval.change]
                yield self._sender_series(interval.quantity, rows), found, ~np.isnan(found)

    def _others(self, plot: Plot, rows: DeviceRows, leave: frozenset[str]) -> Iterator[Column]:
        for column in fields.columns(rows.of, rows.table, leave):
            parts = (MESSAGES, plot.table, *column.name)
            if column.kind == "number":
                series = self._known(path(*parts, *rows.unit.parts)) or Series(
                    path(*parts, *rows.unit.parts), "line", "/".join(parts[1:]), rows.unit.title, column.unit,
                    unit=rows.unit.title, owner=MESSAGES, number=rows.unit.number,
                )  # fmt: skip
                yield series, column.values, column.has
            else:
                self._states(parts, column, rows, None)

    def _unchanged(self, plot: Plot, name: str, rows: DeviceRows, has: Array | None) -> bool:
        """Return True if none of the states in a word changed: known at once, without a look at each of them."""
        note = None if rows.of is None else rows.of.notes.get(name)
        mask = sum((1 << part.width) - 1 << part.low for part in note.parts if part.flag or part.enum) if note else 0
        if name not in rows.table.schema.names:
            return True
        array = rows.table.column(name)
        if not mask or array.null_count or not pa.types.is_unsigned_integer(array.type):
            return False
        word = numbers(array) if has is None else numbers(array)[has]
        lane = f"{plot.table} {name} {' '.join(rows.unit.parts)}"
        return not len(self._lanes.changes(lane, word & word.dtype.type(mask)))

    def _states(self, parts: tuple[str, ...], column: fields.Column, rows: DeviceRows, has: Array | None) -> None:
        entity = path(*parts, *rows.unit.parts)
        has = _both(column.has, has)
        codes = column.values if has is None else column.values[has]
        changes = self._lanes.changes(entity, codes)
        if not len(changes):
            return
        flag = column.kind == "flag"
        series = self._known(entity) or Series(
            entity, "state", "/".join(parts[1:]), rows.unit.title, unit=rows.unit.title,
            owner=rows.unit.owner if parts[0] == STATES else MESSAGES, number=rows.unit.number, flag=flag,
            active=not flag, states=() if flag else tuple(text for _, text in sorted(column.texts.items())),
        )  # fmt: skip
        series.active |= bool(codes[changes].any())
        moments = rows.moments if has is None else rows.moments[has]
        self._canvas.states(series, names(codes[changes], column.texts, flag=flag), moments[changes])

    def _series(self, quantity: str, role: str, unit: Unit) -> Series:
        entity = path(quantity, *([role] if role else []), *unit.parts)
        return self._known(entity) or Series(
            entity, "line", quantity, unit.title, self._pictures.quantities[quantity].unit, role, unit.title,
            unit.owner, unit.number,
        )  # fmt: skip

    def _sender_series(self, quantity: str, rows: DeviceRows) -> Series:
        bus, node, name = rows.sender
        entity = path(quantity, *([name] if bus else []), f"node{node}")
        title = f"{name} node {node}" if bus else f"node {node}"
        return self._known(entity) or Series(
            entity, "line", quantity, title, self._pictures.quantities[quantity].unit, "", title, "node", node
        )  # fmt: skip

    def _known(self, entity: str) -> Series | None:
        return self._canvas.inventory.series.get(entity)


def _word(rows: DeviceRows, name: str) -> Iterator[fields.Column]:
    """Give a column and its parts."""
    for field in rows.table.schema.names:
        if field == name or field.startswith(f"{name}."):
            yield from fields.column(rows.of, rows.table, field)


def _both(one: Array | None, other: Array | None) -> Array | None:
    if one is None or other is None:
        return other if one is None else one
    return one & other
