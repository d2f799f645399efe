"""Numbers of a column that are beyond limits: nearly always none are, as the least and the greatest show."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from dissectors.kit import Array

NOTHING = np.empty(0, np.int64)


def outside(shown: Array, low: float, high: float) -> Array:
    """Return the places of numbers below `low` or above `high`; infinite limits are none, and NaN is inside."""
    if not len(shown):
        return NOTHING
    below = low > -np.inf and not np.minimum.reduce(shown) >= low  # or a NaN is among them
    above = high < np.inf and not np.maximum.reduce(shown) <= high
    if not below and not above:
        return NOTHING
    wrong = shown < low if below else shown > high
    if below and above:
        wrong |= shown > high
    places: Array = wrong.nonzero()[0]
    return places
