"""Groups of ESCs that differ as groups: two packs, the lower motors of coaxial pairs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.flight.robust import spread
from analyzer.flight.thresholds import threshold

if TYPE_CHECKING:
    from dissectors.kit import Array

_FEWEST = 2


def layers(level: Array, least: float, tolerated: float) -> Array:
    """Return for each value whether it is in the upper one of two groups; all False if they are one.

    They are two if the gap between them is wide - more than `least`, and several times the spread inside of each, but
    no less than `tolerated` - and neither has but a few: those are the odd ones.
    """
    known = np.flatnonzero(np.isfinite(level))
    order = known[np.argsort(level[known], kind="stable")]
    values = level[order]
    fewest = max(_FEWEST, int(np.ceil(threshold("layer_share") * len(values))))
    best, upper = 0.0, np.zeros(len(level), bool)
    for k in range(fewest, len(values) - fewest + 1):
        gap = float(values[k] - values[k - 1])
        inside = max(float(spread(values[:k])), float(spread(values[k:])), tolerated / 4)
        if gap > max(best, least) and gap >= threshold("layer_gap") * inside:
            best = gap
            upper = np.zeros(len(level), bool)
            upper[order[k:]] = True
    return upper
