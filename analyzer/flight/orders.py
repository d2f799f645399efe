"""Throttles that ESCs are commanded, a row a command and a column a channel; read once for all who look at them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.decode.grouped import grouped
from analyzer.devices import fields
from dissectors.kit.cells import numbers
from dissectors.kit.order import changes, groups
from dissectors.records import dataclass
from dissectors.times import NO_TIME

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import pyarrow as pa

    from analyzer.decode.engine import Batch
    from analyzer.flight.clock import RecordedClock, RowPlaces
    from analyzer.flight.tables import ReportReader
    from dissectors import Registry
    from dissectors.kit import Array
    from dissectors.picture import Plot


@dataclass(frozen=True, slots=True)
class Orders:
    """The commands of a table. `columns` are throttles in % by place, NaN where there is none."""

    columns: Array
    sender: Array
    highest: Array
    lowest: Array

    def take(self, rows: Array) -> Orders:
        """Return some of them."""
        return Orders(self.columns[:, rows], self.sender[rows], self.highest[rows], self.lowest[rows])


@dataclass(frozen=True, slots=True)
class Commands:
    """The commands of one sender in a batch, all with a time. `columns` are throttles in % by place, NaN for none."""

    plot: Plot
    bus: int
    node: int
    columns: Array
    highest: Array
    lowest: Array
    at: RowPlaces


class CommandReader:
    """Reads the commands of each batch. The `clock` is fed before; `plots` are those that command."""

    def __init__(self, registry: Registry, plots: Sequence[Plot], clock: RecordedClock, reader: ReportReader) -> None:
        self.plots = [plot for plot in plots if plot.esc.commanded]
        self.now: list[Commands] = []
        self._registry, self._clock, self._reader = registry, clock, reader

    def feed(self, batch: Batch) -> None:
        """Take the next batch: its commands are `now`."""
        self.now = []
        for plot in self.plots:
            if (table := self._reader.rows(plot.table, batch)) is None:
                continue
            found = orders(self._registry, plot, table)
            if found is None:
                continue
            at = self._clock.of(table)
            good = ~np.isnan(found.highest) & (at.t != NO_TIME)
            if not good.all() or (found.sender != found.sender[0]).any():
                rows = np.flatnonzero(good)
                rows = rows[grouped(found.sender[rows])[0]]
                found, at = found.take(rows), at.take(rows).settled()
            borders = [*changes(found.sender, -1).tolist(), len(found.sender)]
            for mine in map(slice, borders[:-1], borders[1:]):
                key, columns = int(found.sender[mine.start]), found.columns[:, mine]
                highest, lowest = found.highest[mine], found.lowest[mine]
                self.now.append(Commands(plot, key >> 8, key & 0xFF, columns, highest, lowest, at.take(mine)))


def orders(registry: Registry, plot: Plot, table: pa.RecordBatch) -> Orders | None:
    """Return the commands of a table, None if it has none."""
    of = registry.definition(plot.table)
    if (whole := fields.even(of, table, plot.esc.commanded)) is not None:
        columns = np.ascontiguousarray(whole.T, np.float32)
    else:
        found = fields.elements(of, table, plot.esc.commanded)
        if found is None or not len(table) or not len(found[0]):
            return None
        row, place, values = found
        good = values.has
        width = int(place.max()) + 1
        columns = np.full((width, len(table)), np.nan, np.float32)
        rows = slice(None) if good is None else good
        columns[place[rows], row[rows]] = values.values[rows]
    sender = numbers(table.column("bus")).astype(np.int64) << 8 | numbers(table.column("src"))
    return Orders(columns, sender, np.fmax.reduce(columns, axis=0), np.fmin.reduce(columns, axis=0))


def by_sender(sender: Array, good: Array) -> Iterator[tuple[int, Array | slice]]:
    """Yield each sender, and its good rows; mostly there is one, and nothing has to be copied."""
    if good.all() and (sender == sender[0]).all():
        yield int(sender[0]), slice(None)
        return
    some = np.flatnonzero(good)
    yield from ((key, some[places]) for key, places in groups(sender[some]))
