"""The rows of a table that can be trusted, and the device that each of them speaks of, as one number."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from dissectors.kit.cells import numbers, valid

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array
    from dissectors.picture import Who

NUMBER_BITS = 32  # of a device's number in a key
_MOST_NUMBER = 1 << 20


def usable(table: pa.RecordBatch) -> pa.RecordBatch:
    """Return rows whose transfers, and packets, are whole."""
    rows = numbers(table.column("trusted"))
    if "packet_ok" in table.schema.names:
        rows = rows & numbers(table.column("packet_ok"))
    return table if rows.all() else table.filter(pa.array(rows))


def keyed(table: pa.RecordBatch, who: Who) -> tuple[pa.RecordBatch, Array]:
    """Return the rows that say of which device they speak, and the key of that device for each (i64); see `split`."""
    key = numbers(table.column("bus")).astype(np.int64) << 8 | numbers(table.column("src"))
    if not who.column:
        return table, key << NUMBER_BITS
    if who.column not in table.schema.names:
        return table.slice(0, 0), key[:0]
    column = table.column(who.column)
    if column.null_count:
        has = valid(column)
        table, key, column = table.filter(pa.array(has)), key[has], column.filter(pa.array(has))
    number = numbers(column)
    if pa.types.is_floating(column.type):
        number = np.nan_to_num(number)
    if len(number) and (number.min() < 0 or number.max() > _MOST_NUMBER):
        number = np.clip(number, 0, _MOST_NUMBER)
    return table, key << NUMBER_BITS | number.astype(np.int64)


def pieces(table: pa.RecordBatch, who: Who) -> Iterator[tuple[pa.RecordBatch, int, int, int]]:
    """Yield the rows of each device in their order, with its bus, node and number.

    Devices in the order of appearance.
    """
    table, key = keyed(table, who)
    if not len(key):
        return
    if (key[0] == key).all():
        yield table, *split(int(key[0]))
        return
    order = np.argsort(key, kind="stable")
    ordered = key[order]
    table = table.take(pa.array(order))
    starts = [0, *(np.flatnonzero(np.diff(ordered)) + 1).tolist()]
    ends = [*starts[1:], len(ordered)]
    for _, start, end in sorted((int(order[start]), start, end) for start, end in zip(starts, ends, strict=True)):
        yield table.slice(start, end - start), *split(int(ordered[start]))


def split(key: int) -> tuple[int, int, int]:
    """Return bus, node and number of a device."""
    return key >> NUMBER_BITS + 8, key >> NUMBER_BITS & 0xFF, key & (1 << NUMBER_BITS) - 1
