"""The reports of a batch by device, made once for all that look for something in them."""

from __future__ import annotations

from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from analyzer.decode.grouped import grouped
from analyzer.devices import fields
from analyzer.devices.rows import keyed, usable
from dissectors.kit.cells import floats
from dissectors.times import NO_TIME

if TYPE_CHECKING:
    import pyarrow as pa

    from analyzer.decode.engine import Batch
    from analyzer.flight.clock import RecordedClock, RowPlaces
    from dissectors import Registry
    from dissectors.kit import Array
    from dissectors.picture import Plot
    from dissectors.schema import Message, Packet


class ReportTable:
    """The usable rows of a table that have a time and say of which device they speak: at least one.

    They stand in the order of the devices, those of one device in order, so that each of these is a slice. `order` are
    their rows in the table, `at` their places.

    Args:
        plot: what is known of it.
        of: its definition.
        table: its rows, each with its `device`.
        at: their places.
    """

    def __init__(
        self, plot: Plot, of: Message | Packet | None, table: pa.RecordBatch, device: Array, at: RowPlaces
    ) -> None:
        self.plot, self.of, self.table = plot, of, table
        order, begins = grouped(device)
        keys, self._ends = device[order[begins]], [*begins.tolist(), len(device)]
        self._keys: list[int] = keys.tolist()
        timed = at.t[order] != NO_TIME
        if not timed.all():
            left = np.concatenate(([0], np.cumsum(timed)))
            order, self._ends = order[timed], left[self._ends].tolist()
        self.order, self.at = order, at.take(order).settled()
        self._numbers: dict[str, Array] = {}
        self._extremes: dict[str, tuple[list[float], list[float]]] = {}

    @cached_property
    def devices(self) -> list[tuple[int, slice, RowPlaces]]:
        """Each device by its key, its rows in the order of devices, and their places."""
        return [
            (key, slice(start, stop), self.at.take(slice(start, stop)))
            for key, (start, stop) in zip(self._keys, pairwise(self._ends), strict=True)
            if start < stop
        ]

    def column(self, name: str) -> fields.Column | None:
        """Return a column of numbers as the table has it; None if it has none of that name."""
        found = fields.column(self.of, self.table, name) if name else []
        return found[0] if found else None

    def numbers(self, name: str) -> Array:
        """Return a column as f64 in the order of devices, NaN where a row does not say, or all if there is none."""
        known = self._numbers.get(name)
        if known is None:
            known = self._numbers[name] = self._read(name)
        return known

    def extremes(self, name: str) -> tuple[list[float], list[float]]:
        """Return the lowest and the highest number of a column for each of `devices`, NaN where none says one."""
        known = self._extremes.get(name)
        if known is None:
            values, starts = self.numbers(name), [rows.start for _, rows, _ in self.devices]
            lows, highs = (extreme.reduceat(values, starts).tolist() for extreme in (np.fmin, np.fmax))
            known = self._extremes[name] = lows, highs
        return known

    def _read(self, name: str) -> Array:
        found = self.column(name)
        if found is None:
            return np.full(len(self.order), np.nan)
        values: Array = floats(found.values[self.order])
        return values if found.has is None else np.where(found.has[self.order], values, np.nan)


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

    def release(self) -> None:
        """Let the tables of the batch go."""
        self._turn_to(None)

    def _turn_to(self, batch: Batch | None) -> None:
        if self._batch is not batch:
            self._batch, self._tables, self._rows = batch, {}, {}

    def _read(self, plot: Plot, batch: Batch) -> ReportTable | None:
        if (some := self.rows(plot.table, batch)) is None:
            return None
        table, device = keyed(some, plot.who)
        if not len(table):
            return None
        made = ReportTable(plot, self._registry.definition(plot.table), table, device, self._clock.of(table))
        return made if len(made.order) else None
