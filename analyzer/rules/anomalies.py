"""Rows that the core marked, and a word for what is too long ago to be told."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from dissectors.kit import Array

GONE = "?"  # in place of what stood in a frame that is too long ago


def flagged(anomaly: Array, bits: int) -> Array:
    """Return the rows that have one of the bits; costs next to nothing if none has."""
    if not len(anomaly) or not int(np.bitwise_or.reduce(anomaly)) & bits:
        return np.empty(0, np.int64)
    return np.flatnonzero(anomaly & anomaly.dtype.type(bits))
