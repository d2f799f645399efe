"""Robust statistics: medians, so that one odd value moves nothing but itself."""

from __future__ import annotations

from math import isnan, nan
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dissectors.kit import Array

FEWEST = 3  # devices: of two nobody can say which one is odd
_MAD = 1.4826  # of the median absolute deviation of a normal distribution, its standard deviation


def middle(values: Array, axis: int | None = None) -> Array:
    """Return the median of what is known, NaN of nothing; numpy's own is slow for small arrays."""
    some, axis = (values.ravel(), 0) if axis is None else (values, axis)
    count = np.expand_dims((~np.isnan(some)).sum(axis=axis), axis)
    if not some.shape[axis]:
        return np.full(count.shape, np.nan).squeeze(axis)
    ordered = np.sort(some, axis=axis)  # NaN stands behind all others
    low, high = (np.take_along_axis(ordered, np.maximum(at, 0), axis) for at in ((count - 1) // 2, count // 2))
    found: Array = np.where(count > 0, (low + high) / 2, np.nan).squeeze(axis)
    return found


def of_few(values: Sequence[float]) -> float:
    """Return the median of a few numbers as `np.median` does, which takes much longer for that; NaN of none."""
    if not values or any(map(isnan, values)):
        return nan
    ordered, half = sorted(values), len(values) // 2
    return float(ordered[half]) if len(values) % 2 else (ordered[half - 1] + ordered[half]) / 2


def spread(values: Array, axis: int | None = None) -> Array:
    """Return a standard deviation by the median distance from the median, NaN of nothing."""
    centre = middle(values, axis) if axis is None else np.expand_dims(middle(values, axis), axis)
    found: Array = _MAD * middle(np.abs(values - centre), axis)
    return found


def others(values: Array) -> Array:
    """Return the median of the others for each value (last axis), NaN where fewer than two of them are known."""
    count = values.shape[-1]
    found = np.full(values.shape, np.nan)
    for k in range(count):
        rest = np.delete(values, k, axis=-1)
        known = np.isfinite(rest).sum(axis=-1) >= FEWEST - 1
        found[..., k] = np.where(known, middle(rest, -1), np.nan)
    return found


def against_others(values: Array, tolerated: float) -> Array:
    """Return how far each value is from the median of the others, in standard deviations of the others.

    These are never less than `tolerated`, in the unit of the values. NaN for what is not known, or has too few others.
    """
    centre = others(values)
    found = np.full(values.shape, np.nan)
    for k in range(len(values)):
        wide = float(np.nan_to_num(spread(np.delete(values, k))))
        found[k] = (values[k] - centre[k]) / np.hypot(wide, tolerated)
    return found
