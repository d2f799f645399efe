"""Intervals, tests and the control of false discoveries, as the reports use them."""

from __future__ import annotations

from math import erfc, log, sqrt
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dissectors.kit import Array

FALSE_DISCOVERIES = 0.01  # share of what is reported that may be chance; one of a hundred alarms is for nothing
_Z95 = 1.959964
_SIGMA = 1.4826  # from the median absolute deviation to the standard deviation of a normal distribution
_POWER = 2.576 + 0.842  # a test at 1 % sees it in four of five cases
_RATIOS = (1.25, 1.5, 2.0, 3.0, 5.0, 10.0)


def rate_interval(count: int, exposure: float) -> tuple[float, float]:
    """Return the 95 % interval of a Poisson rate (Byar's approximation of the exact one)."""
    low = count * (1 - 1 / (9 * count) - _Z95 / (3 * sqrt(count))) ** 3 if count else 0.0
    more = count + 1
    high = more * (1 - 1 / (9 * more) + _Z95 / (3 * sqrt(more))) ** 3
    return max(low, 0.0) / exposure, high / exposure


def binomial_p(count: int, of: int, part: float) -> float:
    """Return the two-sided p of so many of so many, if each has this chance: exact."""
    if not of or not 0 < part < 1:
        return 1.0
    k = np.arange(of + 1)
    logs = np.concatenate(([0.0], np.cumsum(np.log(np.arange(1, of + 1)))))
    chance = np.exp(logs[of] - logs - logs[::-1] + k * log(part) + (of - k) * log(1 - part))
    return float(min(1.0, chance[chance <= chance[count] * (1 + 1e-9)].sum()))


def discoveries(chances: Sequence[float], share: float = FALSE_DISCOVERIES) -> list[bool]:
    """Return which p of all that were tested count, by Benjamini and Hochberg."""
    order = np.argsort(chances)
    ranked = np.asarray(chances, float)[order]
    good = np.flatnonzero(ranked <= share * np.arange(1, len(ranked) + 1) / max(len(ranked), 1))
    found = np.zeros(len(ranked), bool)
    if len(good):
        found[order[: good[-1] + 1]] = True
    return [bool(one) for one in found]


def trend_p(values: Array) -> float:
    """Return the two-sided p of Spearman's correlation with the order."""
    n = len(values)
    ranks = np.empty(n)
    ranks[np.argsort(values, kind="stable")] = np.arange(n)
    if n < 3 or float(np.ptp(values)) == 0:
        return 1.0
    rho = float(np.corrcoef(ranks, np.arange(n))[0, 1])
    return erfc(abs(rho) * sqrt(n - 1) / sqrt(2))


def normal_p(z: float) -> float:
    """Return the two-sided p of so many standard deviations."""
    return erfc(abs(z) / sqrt(2))


def spread(values: Array) -> float:
    """Return a robust standard deviation."""
    return _SIGMA * float(np.median(np.abs(values - np.median(values)))) if len(values) else 0.0


def turning_point(values: Array) -> int:
    """Return the place from which values are different: a step or the start of a slope, whichever fits better."""
    n = len(values)
    at = np.arange(n)
    best, place = np.inf, 0
    for first in range(1, n - 1):
        for shape in ((at >= first).astype(float), np.clip(at - first + 1, 0, None).astype(float)):
            design = np.stack([np.ones(n), shape], axis=1)
            _, left, *_ = np.linalg.lstsq(design, values, rcond=None)
            if len(left) and left[0] < best:
                best, place = float(left[0]), first
    return place


def seen_ratio(before: int, hours_before: float, hours_after: float) -> float | None:
    """Return the smallest growth of a rate that would be seen four times in five, None for no growth up to tenfold."""
    if not before or hours_before <= 0 or hours_after <= 0:
        return None
    for ratio in _RATIOS:
        after = before / hours_before * hours_after * ratio
        if after > 0 and log(ratio) / sqrt(1 / before + 1 / after) >= _POWER:
            return ratio
    return None
