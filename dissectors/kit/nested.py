"""Numbers inside Arrow columns of lists and structures."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from dissectors.kit.cells import numbers, offsets_of, valid

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from dissectors.kit.array import Array


def inner(array: pa.Array, rows: Array, members: Sequence[str]) -> tuple[Array, Array]:
    """Return the numbers of a column, also those inside lists and, along `members`, structures: rows and values."""
    if array.null_count:
        has = valid(array)
        array, rows = array.filter(pa.array(has)), rows[has]
    if pa.types.is_list(array.type):
        ends = offsets_of(array).astype(np.int64)
        inside = array.values.slice(ends[0], ends[-1] - ends[0])
        return inner(inside, np.repeat(rows, np.diff(ends)), members)
    if members:
        return inner(array.field(members[0]), rows, members[1:])
    return rows, numbers(array)


def not_finite(array: pa.Array, name: str) -> Iterator[tuple[str, Array, Array]]:
    """Yield floats that are NaN or infinite, also inside structures: dotted name, places in order, values."""
    kind = array.type
    if pa.types.is_struct(kind):
        for k in range(kind.num_fields):
            yield from not_finite(array.field(k), f"{name}.{kind.field(k).name}")
    elif pa.types.is_list(kind):
        ends = offsets_of(array).astype(np.int64)
        for path, places, values in not_finite(array.values, name):
            yield path, ends.searchsorted(places, "right") - 1, values
    elif pa.types.is_floating(kind):
        values = numbers(array)
        rows = (~np.isfinite(values)).nonzero()[0]
        if len(rows) and array.null_count:
            rows = rows[valid(array)[rows]]
        if len(rows):
            yield name, rows, values[rows]


def listed(array: pa.Array) -> tuple[Array, Array]:
    """Return offsets from 0 and values of a list column."""
    offsets = offsets_of(array).astype(np.int64)
    values = numbers(array.values.slice(offsets[0], offsets[-1] - offsets[0])) if len(offsets) else np.empty(0)
    return offsets - (offsets[0] if len(offsets) else 0), values
