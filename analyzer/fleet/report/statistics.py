"""Intervals, tests and the control of false discoveries, as the reports use them."""

from __future__ import annotations

from math import erfc, log, sqrt
from statistics import NormalDist
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dissectors.kit import Array

FALSE_DISCOVERIES = 0.01  # share of what is reported that may be chance; one of a hundred alarms is for nothing
_Z95 = 1.959964
_SIGMA = 1.4826  # from the median absolute deviation to the standard deviation of a normal distribution
_OF_A_MEDIAN = 1.5708  # its variance, as a multiple of that of a mean
_POWER = 2.576 + 0.842  # a test at 1 % sees it in four of five cases
_MANY = 1000.0  # variance of a sum of counts beyond which it is as good as normal
_RATIOS = (1.25, 1.5, 2.0, 3.0, 5.0, 10.0)


def rate_interval(count: float, exposure: float) -> tuple[float, float]:
    """Return the 95 % interval of a Poisson rate (Byar's approximation of the exact one)."""
    low = count * (1 - 1 / (9 * count) - _Z95 / (3 * sqrt(count))) ** 3 if count else 0.0
    more = count + 1
    high = more * (1 - 1 / (9 * more) + _Z95 / (3 * sqrt(more))) ** 3
    return max(low, 0.0) / exposure, high / exposure


def binomial_p(count: int, of: int, part: float) -> float:
    """Return the two-sided p of so many of so many, if each has this chance: exact."""
    if not of or not 0 < part < 1:
        return 1.0
    return _two_sided(_binomial(of, part), count)


def stratified_p(counts: Sequence[tuple[int, int, float]]) -> float:
    """Return the two-sided p of the sum of such counts, each with a chance of its own: so many, of so many, chance."""
    some = [(count, of, part) for count, of, part in counts if of and 0 < part < 1]
    if not some:
        return 1.0
    count, width = sum(one for one, _, _ in some), sum(of * part * (1 - part) for _, of, part in some)
    if width > _MANY:
        return normal_p(max(abs(count - sum(of * part for _, of, part in some)) - 0.5, 0.0) / sqrt(width))
    chance = np.ones(1)
    for _, of, part in some:
        chance = np.convolve(chance, _binomial(of, part))
    return _two_sided(chance, count)


def _binomial(of: int, part: float) -> Array:
    k = np.arange(of + 1)
    logs = np.concatenate(([0.0], np.cumsum(np.log(np.arange(1, of + 1)))))
    chance: Array = np.exp(logs[of] - logs - logs[::-1] + k * log(part) + (of - k) * log(1 - part))
    return chance


def _two_sided(chance: Array, count: int) -> float:
    return float(min(1.0, chance[chance <= chance[count] * (1 + 1e-9)].sum()))


def dispersion(groups: Sequence[Sequence[tuple[int, float]]]) -> float:
    """Return how much more counts differ within groups than chance has them: 1 for no more; each with its exposure.

    Where a few vehicles have nearly all of something, it says little of what these vehicles have in common.
    """
    apart, free = 0.0, 0
    for group in groups:
        rate = sum(count for count, _ in group) / (sum(exposure for _, exposure in group) or 1.0)
        if rate:
            apart += sum((count - rate * exposure) ** 2 / (rate * exposure) for count, exposure in group)
            free += len(group) - 1
    return max(1.0, apart / free) if free else 1.0


def dispersed_p(p: float, by: float) -> float:
    """Return a two-sided p of counts that differ by more than chance."""
    return normal_p(NormalDist().inv_cdf(max(p, 1e-300) / 2) / sqrt(by))


def discoveries(chances: Sequence[float], share: float = FALSE_DISCOVERIES) -> list[bool]:
    """Return which p of all that were tested count, by Benjamini and Hochberg."""
    order = np.argsort(chances)
    ranked = np.asarray(chances, float)[order]
    good = np.flatnonzero(ranked <= share * np.arange(1, len(ranked) + 1) / max(len(ranked), 1))
    found = np.zeros(len(ranked), bool)
    if len(good):
        found[order[: good[-1] + 1]] = True
    return [bool(one) for one in found]


def level_p(now: Array, past: Array, noise: float) -> float:
    """Return the two-sided p of the medians of two groups of values that differ by so much noise."""
    off = float(np.median(now) - np.median(past))
    return normal_p(off / (noise * sqrt(_OF_A_MEDIAN * (1 / len(now) + 1 / len(past)))))


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
