"""The reports of a batch by device, made once for all that look for something in them."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from analyzer.devices import fields
from analyzer.devices.rows import keyed, usable
from dissectors.kit.order import groups
from dissectors.times import NO_TIME

if TYPE_CHECKING:
    import pyarrow as pa

    from analyzer.decode.engine import Batch
    from analyzer.flight.clock import Places, RecordedClock
    from dissectors import Registry
    from dissectors.kit import Array
    from dissectors.picture import Plot
    from dissectors.schema import Message, Packet


class ReportTable:
    """The usable rows of a table that say of which device they speak; at least one.

    Args:
        plot: what is known of it.
        of: its definition.
        table: its rows, each with its `device`.
        at: their places.
    """

    def __init__(
        self, plot: Plot, of: Message | Packet | None, table: pa.RecordBatch, device: Array, at: Places
    ) -> None:
        self.plot, self.of, self.table, self.at = plot, of, table, at
        self._device = device
        self._numbers: dict[str, Array] = {}

    @cached_property
    def timed(self) -> Array:
        """The rows that have a time, as a mask."""
        timed: Array = self.at.t != NO_TIME
        return timed

    @cached_property
    def devices(self) -> list[tuple[int, Array, Places]]:
        """Each device by its key, its rows, in order, and their places."""
        return [(key, rows, self.at.take(rows)) for key, rows in groups(self._device)]

    def column(self, name: str) -> fields.Column | None:
        """Return a column of numbers; None if the table has none of that name."""
        found = fields.column(self.of, self.table, name) if name else []
        return found[0] if found else None

    def numbers(self, name: str) -> Array:
        """Return a column as f64, NaN where a row does not say, or all of them if there is no such column."""
        known = self._numbers.get(name)
        if known is None:
            known = self._numbers[name] = self._read(name)
        return known

    def _read(self, name: str) -> Array:
        found = self.column(name)
        if found is None:
            return np.full(len(self.table), np.nan)
        values: Array = found.values.astype(np.float64)
        return values if found.has is None else np.where(found.has, values, np.nan)


class ReportReader:
    """Reads the tables of each batch when they are asked for. The `clock` is fed before."""

    def __init__(self, registry: Registry, clock: RecordedClock) -> None:
        self._registry, self._clock = registry, clock
        self._batch: Batch | None = None
        self._tables: dict[str, ReportTable | None] = {}
        self._rows: dict[str, pa.RecordBatch | None] = {}

    def table(self, plot: Plot, batch: Batch) -> ReportTable | None:
        """Return the table of a plot; None if the batch has no row of it that can be used."""
        self._turn_to(batch)
        if plot.table not in self._tables:
            self._tables[plot.table] = self._read(plot, batch)
        return self._tables[plot.table]

    def rows(self, name: str, batch: Batch) -> pa.RecordBatch | None:
        """Return the rows of a table that can be used, whether they say of which device or not; None without any."""
        self._turn_to(batch)
        if name not in self._rows:
            table = batch.messages.get(name)
            self._rows[name] = None if table is None or not len(table := usable(table)) else table
        return self._rows[name]

    def _turn_to(self, batch: Batch) -> None:
        if self._batch is not batch:
            self._batch, self._tables, self._rows = batch, {}, {}

    def _read(self, plot: Plot, batch: Batch) -> ReportTable | None:
        if (some := self.rows(plot.table, batch)) is None:
            return None
        table, device = keyed(some, plot.who)
        if not len(table):
            return None
        return ReportTable(plot, self._registry.definition(plot.table), table, device, self._clock.of(table))
