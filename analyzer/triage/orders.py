"""Throttles that ESCs are commanded, a row a command and a column a channel."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.devices import fields
from dissectors.kit.cells import numbers
from dissectors.kit.order import groups
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Iterator

    import pyarrow as pa

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


def orders(registry: Registry, plot: Plot, table: pa.RecordBatch) -> Orders | None:
    """Return the commands of a table, None if it has none."""
    found = fields.elements(registry.definition(plot.table), table, plot.esc.commanded)
    if found is None or not len(table) or not len(found[0]):
        return None
    row, place, values = found
    good = values.has
    width = int(place.max()) + 1
    if len(row) == width * len(table) and (good is None or good.all()):
        columns = np.ascontiguousarray(values.values.reshape(len(table), width).T)
    else:
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
