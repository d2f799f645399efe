"""The courses and the levels of all quantities of ESCs that can be compared with each other."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.flight.odd.cells import COUNTED, MEASURED, ONE
from analyzer.flight.odd.past import BinnedPast, RatePast, SlotPast, WarmthPast
from analyzer.flight.odd.quantities import CURRENT, LATE, LOST, SPEED, TEMPERATURE, VOLTAGE
from analyzer.flight.robust import middle, others
from analyzer.flight.thresholds import lasting, threshold
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analyzer.flight.odd.cells import EscCells
    from analyzer.flight.odd.past import QuantityPast
    from analyzer.flight.odd.quantities import EscQuantity
    from dissectors.kit import Array

_FAR = 2  # bins beyond those of another ESC, in which nothing is known of it


@dataclass(frozen=True, slots=True)
class QuantityCourse:
    """A quantity of several ESCs: how each went, and its `level`: how far it is from the median of all, NaN if unknown.

    Relative quantities are natural logarithms, so that a difference is a share.
    """

    quantity: EscQuantity
    past: QuantityPast
    level: Array


def courses(devices: Sequence[EscCells], width: int) -> Iterator[QuantityCourse]:
    """Yield those quantities of devices that are told; `width` is that of a slot, in ns."""
    for quantity in (SPEED, CURRENT):
        kind = _told(devices, quantity)
        count, total = (np.stack([getattr(one, name)[kind] for one in devices]) for name in ("count", "total"))
        if count.any():
            total = total / ONE
            yield QuantityCourse(
                quantity, BinnedPast(count, total), _binned_level(count.sum(axis=1), total.sum(axis=1))
            )
    counts, means = zip(*(_stacked(devices, name) for name in MEASURED), strict=True)
    warm, volts, power = means
    if np.isfinite(warm).any():
        above, than, level = _warmth(warm, power, width)
        yield QuantityCourse(TEMPERATURE, WarmthPast(above, than, counts[0]), level)
    if np.isfinite(volts).any():
        behind = volts.copy()
        behind[:, : _half(volts)] = np.nan
        yield QuantityCourse(VOLTAGE, SlotPast(volts, counts[1]), middle(behind - middle(behind, 0), 1))
    came, lost, late = (np.stack([one.numbers(name) for one in devices]) for name in COUNTED)
    for quantity, hits, all_ in ((LOST, lost, came + lost), (LATE, late, came)):
        with np.errstate(divide="ignore", invalid="ignore"):
            share = hits.sum(axis=1) / all_.sum(axis=1)
        share = np.where((hits > 0).sum(axis=1) >= threshold("odd_slots"), share, 0.0)  # a burst is an event
        yield QuantityCourse(quantity, RatePast(hits, all_), share - middle(share))


def _stacked(devices: Sequence[EscCells], name: str) -> tuple[Array, Array]:
    """Return count and mean of what is measured, by device and slot."""
    counts, means = zip(*(one.mean(name) for one in devices), strict=True)
    return np.stack(counts), np.stack(means)


def _told(devices: Sequence[EscCells], quantity: EscQuantity) -> int:
    """Return the kind of sums that tell a quantity: those without voltages if too few reports have one."""
    whole, plain = (sum(one.count[kind].sum() for one in devices) for kind in (quantity.number, quantity.plain))
    return quantity.number if 2 * whole >= plain else quantity.plain


def _binned_level(count: Array, total: Array) -> Array:
    """Return how far the mean of each device is from the median of all in its bins, as a natural logarithm.

    `count` and `total` are by device and bin.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        mean = np.log(total / count)
    at = np.arange(count.shape[1])
    apart = np.full((len(count), len(count)), np.nan)
    for k, (many, own) in enumerate(zip(count, mean, strict=True)):
        for j, its in enumerate(mean):
            known = np.flatnonzero(np.isfinite(its))
            if not len(known) or not many.any():
                continue
            near = (at >= known[0] - _FAR) & (at <= known[-1] + _FAR)
            weight = np.where(near, many, 0)
            if 2 * weight.sum() >= many.sum():
                like = np.interp(at, known, its[known])
                apart[k, j] = (weight * np.nan_to_num(own - like)).sum() / weight.sum()
    return middle(apart, 1)


def _warmth(warm: Array, power: Array, width: int) -> tuple[Array, Array, Array]:
    """Return by how much devices got warmer than the others at their power, by slot; how much these did; and levels."""
    than = others(warm.T).T
    both = np.isfinite(warm) & np.isfinite(than)
    first = both.argmax(axis=1)[:, None]
    own, its = (np.take_along_axis(one, first, 1) for one in (warm, than))
    share = _power_share(power, width)
    above = (warm - own) - (than - its) * share
    air = np.nanmin(np.append(own[both.any(axis=1)], np.nanmin(warm)))
    level = (warm - air) - (than - air) * share
    level[:, : _half(warm)] = np.nan
    levels = middle(level, 1)
    return above, than - its, levels - middle(levels)


def _power_share(power: Array, width: int) -> Array:
    """Return the power of each device as a share of that of the others, both in the mean of what warms them now."""
    keep = np.exp(-width / lasting("odd_warm"))
    shares, sums = np.ones_like(power), np.zeros((2, len(power)))
    fed = np.stack((power, others(power.T).T))
    fed[:, ~np.isfinite(fed).all(axis=0)] = np.nan
    for slot in range(power.shape[1]):
        now = fed[:, :, slot]
        has = np.isfinite(now[0])
        sums[:, has] = sums[:, has] * keep + now[:, has]
        with np.errstate(divide="ignore", invalid="ignore"):
            shares[:, slot] = np.where(sums[1] > 0, sums[0] / sums[1], 1.0)
    return shares


def _half(series: Array) -> int:
    """Return the slot in the middle of those that have something."""
    some = np.flatnonzero(np.isfinite(series).any(axis=0))
    return int(some[len(some) // 2]) if len(some) else 0
