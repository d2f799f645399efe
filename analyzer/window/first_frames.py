"""Where transfers begin: the order of a list, and the number that it gives them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit.cells import numbers

if TYPE_CHECKING:
    import pyarrow as pa

    from dissectors.kit import Array


def first_frames(transfers: pa.RecordBatch, rows: Array | None = None) -> Array:
    """Return the place of each transfer's first frame, of some rows or all, from 0 (i64); -1 for one without frames."""
    column = transfers.column("frame")
    if not len(column):
        return np.zeros(0, np.int64)
    ends = np.frombuffer(column.buffers()[1], np.int32)[column.offset : column.offset + len(column) + 1]
    start, end = (ends[:-1], ends[1:]) if rows is None else (ends[rows], ends[rows + 1])
    places, some = numbers(column.values), end > start
    if some.all():
        return places[start].astype(np.int64)
    found = np.full(len(start), -1, np.int64)
    found[some] = places[start[some]]
    return found
