"""Groups of ESCs that differ as groups: two packs, the lower motors of coaxial pairs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.flight.robust import middle, spread
from analyzer.flight.thresholds import threshold

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from dissectors.kit import Array

_FEWEST = 2
_SEVERAL = 6  # values, of which the spread inside of two groups is known well enough to be put together


def layers(level: Array, least: float, tolerated: float, chs: Sequence[int | None] = ()) -> Array:
    """Return for each value whether it is in the upper one of two groups; all False if they are one.

    They are two if the gap between them is wide - more than `least`, and several times the spread inside of each, which
    of few is what is `tolerated` at least - and neither has but a few: those are the odd ones. Where loads are noisy
    that gap closes: then they are two as well if these are just the halves that a vehicle is built of, by its `chs`.
    """
    known = np.flatnonzero(np.isfinite(level))
    order = known[np.argsort(level[known], kind="stable")]
    values = level[order]
    fewest = max(_FEWEST, int(np.ceil(threshold("layer_share") * len(values))))
    best, upper = 0.0, np.zeros(len(level), bool)
    for k in range(fewest, len(values) - fewest + 1):
        gap = float(values[k] - values[k - 1])
        if gap > max(best, least) and _apart(values[:k], values[k:], gap, tolerated):
            best = gap
            upper = np.zeros(len(level), bool)
            upper[order[k:]] = True
    if upper.any() or len(values) < max(_SEVERAL, len(level)):
        return upper
    return next((half for half in _halves(chs) if _is_layer(level, half, least, tolerated)), upper)


def _apart(low: Array, high: Array, gap: float, tolerated: float) -> bool:
    """Return whether two groups are farther from each other than their values are from one another."""
    count = len(low) + len(high)
    least = tolerated / 4 if count >= _SEVERAL else tolerated  # of a few, two may be alike by chance
    if gap >= threshold("layer_gap") * max(float(spread(low)), float(spread(high)), least):
        return True
    pooled = np.sqrt((len(low) * low.var() + len(high) * high.var()) / (count - 2))
    far = threshold("layer_far") * max(float(pooled), tolerated / 4)
    return count >= _SEVERAL and float(high.mean() - low.mean()) >= far


def _halves(chs: Sequence[int | None]) -> Iterator[Array]:
    """Yield the halves of vehicles that are built in two layers: the last channels, or every other one."""
    told = sorted(ch for ch in chs if ch is not None)
    if not told or told != list(range(1, len(chs) + 1)) or len(chs) % 2:
        return
    number = np.array(chs)
    for half in (number > len(chs) // 2, number % 2 == 0):
        yield half
        yield ~half


def _is_layer(level: Array, half: Array, least: float, tolerated: float) -> bool:
    """Return whether every value of a half is above all others, and the medians are far apart."""
    gap = float(middle(level[half]) - middle(level[~half]))
    return bool(level[half].min() > level[~half].max()) and gap >= max(least, threshold("layer_gap") * tolerated)
