"""Rows by key, put in order by the core: what is asked of every frame or transfer of a batch."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer import _native
from analyzer.decode.sent import cells

if TYPE_CHECKING:
    from dissectors.kit import Array


def grouped(keys: Array) -> tuple[Array, Array]:
    """Return what `dissectors.kit.by_key` does: the rows in the order of keys, and where in that each key begins.

    Keys are not negative, and any integers.
    """
    if keys.dtype not in (np.uint32, np.int64):
        keys = keys.astype(np.int64)
    order, begins = _native.grouped(np.ascontiguousarray(keys))
    return cells(order, np.int64), cells(begins, np.int64)
