"""Lists of many rows in columns: list `k` is `cells[offsets[k]:offsets[k + 1]]`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from dissectors.kit import Array


def picked(offsets: Array, rows: Array) -> tuple[Array, Array]:
    """Return the offsets of some lists put one behind the other, and the places of their cells."""
    return placed(offsets[rows], offsets[rows + 1] - offsets[rows])


def placed(begin: Array, sizes: Array) -> tuple[Array, Array]:
    """Return the same of lists that begin at these places and have these sizes."""
    ends = np.concatenate(((0,), np.cumsum(sizes, dtype=np.int64)))
    return ends, np.arange(ends[-1]) + np.repeat(begin - ends[:-1], sizes)
