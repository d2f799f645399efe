"""Numbers of a column that are beyond limits: nearly always none are, which two looks at all of them show."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from dissectors.kit import Array

NOTHING = np.empty(0, np.int64)


def outside(shown: Array, low: float, high: float) -> Array:
    """Return the places of numbers below `low` or above `high`; infinite limits are none, and NaN is inside."""
    if not len(shown) or (np.minimum.reduce(shown) >= low and np.maximum.reduce(shown) <= high):
        return NOTHING
    places: Array = ((shown < low) | (shown > high)).nonzero()[0]
    return places
