"""How each ESC changed in the course of a capture: what came behind a time less what came before it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

import numpy as np

from analyzer.flight.robust import middle
from analyzer.flight.thresholds import threshold

if TYPE_CHECKING:
    from dissectors.kit import Array

_NOISE = 1.4826 / np.sqrt(2)  # of the median of the steps between neighbours, their standard deviation


class QuantityPast(ABC):
    """The course of a quantity, a row a device; slots of time are columns. NaN is what cannot be compared.

    `series` is what the noise of a slot is told by, `slots` says which slots have something.
    """

    series: Array

    @property
    def slots(self) -> Array:
        """Which slots have something, by device."""
        found: Array = np.isfinite(self.series)
        return found

    @abstractmethod
    def change(self, before: Array, after: Array) -> Array:
        """Return how much more the slots from `after` on have than those up to `before`, a column a pair of both."""

    def noise(self, common: Array) -> Array:
        """Return the standard deviation of a change by the noise of slots, a column for each slot that may begin it.

        `common` is what all devices have in common, by slot. Neighbours are told apart by their steps, so that one
        change hides nothing; who is noisier than the others is so, but nobody is quieter.
        """
        steps = np.abs(np.diff(self.series - common, axis=1))
        own, all_ = middle(steps, 1), middle(steps)
        one = _NOISE * np.fmax(own, all_)
        some = self.slots.cumsum(axis=1)
        before = np.concatenate((np.zeros((len(some), 1)), some[:, :-1]), axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            found: Array = one[:, None] * np.sqrt(1 / before + 1 / (some[:, -1:] - before))
        return found

    def enough(self, before: Array, after: Array) -> Array:
        """Return where both sides have slots enough."""
        sums = np.concatenate((np.zeros((len(self.series), 1)), self.slots.cumsum(axis=1)), axis=1)
        fewest = threshold("odd_slots")
        found: Array = (sums[:, before] >= fewest) & (sums[:, -1:] - sums[:, after] >= fewest)
        return found


class BinnedPast(QuantityPast):
    """Compared within bins: what was commanded, or how fast it turned, is the same before and after.

    Changes are natural logarithms of shares.

    Args:
        count: reports by device, slot and bin.
        total: what they say, added up.
    """

    def __init__(self, count: Array, total: Array) -> None:
        self._count, self._total = (_summed(one) for one in (count, total))
        with np.errstate(divide="ignore", invalid="ignore"):
            usual = np.nan_to_num(self._total[:, -1:] / self._count[:, -1:])
            self.series = np.log(total.sum(axis=2) / (count * usual).sum(axis=2))

    def change(self, before: Array, after: Array) -> Array:
        """Return the mean of the changes of all bins, those that have most on both sides weighing most."""
        n, sums = self._count[:, before], self._total[:, before]
        behind, its = self._count[:, -1:] - self._count[:, after], self._total[:, -1:] - self._total[:, after]
        both = (n > 0) & (behind > 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            weight = np.where(both, n * behind / (n + behind), 0.0)
            shares = np.where(both, np.log(its / behind) - np.log(sums / n), 0.0)
            whole = weight.sum(axis=2)
            found = (weight * shares).sum(axis=2) / whole
        good = (whole >= threshold("odd_reports") / 2) & self.enough(before, after)
        return np.where(good, found, np.nan)


class SlotPast(QuantityPast):
    """Compared as it is: the mean of slots behind less that before.

    Args:
        series: means by device and slot.
        count: of how many reports.
    """

    def __init__(self, series: Array, count: Array) -> None:
        self.series = series
        self._count = _summed(np.where(np.isfinite(series), count, 0.0))
        self._sum, self._known = _summed(np.nan_to_num(series)), _summed(np.isfinite(series).astype(float))

    def change(self, before: Array, after: Array) -> Array:
        """Return the difference of the means."""
        with np.errstate(divide="ignore", invalid="ignore"):
            low = self._sum[:, before] / self._known[:, before]
            high = (self._sum[:, -1:] - self._sum[:, after]) / (self._known[:, -1:] - self._known[:, after])
        fewest = threshold("odd_reports")
        told = (self._count[:, before] >= fewest) & (self._count[:, -1:] - self._count[:, after] >= fewest)
        return np.where(told & self.enough(before, after), high - low, np.nan)


class WarmthPast(SlotPast):
    """Temperatures above those of the others, less the part that goes with how warm these are.

    Some ESCs have less air than others, so they are as many percent warmer at all times: that part is learned from
    before, as far as the others were warm enough then, and taken out of what comes behind.

    Args:
        series: by how many degrees each is warmer than the others are at its power.
        warmth: how much warmer these are than at the start.
        count: of how many reports.
    """

    def __init__(self, series: Array, warmth: Array, count: Array) -> None:
        super().__init__(np.where(np.isfinite(warmth), series, np.nan), count)
        self._warmth = SlotPast(np.where(np.isfinite(self.series), warmth, np.nan), count)
        some, above = np.nan_to_num(self._warmth.series), np.nan_to_num(self.series)
        self._square, self._product = _summed(some * some), _summed(some * above)
        self._known_by = (threshold("wander_temperature") / threshold("odd_cooling")) ** 2

    def change(self, before: Array, after: Array) -> Array:
        """Return the change of what its warmth does not explain."""
        slope = self._product[:, before] / (self._square[:, before] + self._known_by)
        found: Array = super().change(before, after) - slope * self._warmth.change(before, after)
        return found

    def noise(self, common: Array) -> Array:
        """Return that of the slots, and that of how little of its cooling was known before."""
        at = np.arange(self.series.shape[1])
        warmer = np.nan_to_num(self._warmth.change(at, at))
        unsure = threshold("odd_cooling") / np.sqrt(1 + self._square[:, at] / self._known_by)
        found: Array = np.hypot(super().noise(common), unsure * warmer)
        return found


class RatePast(QuantityPast):
    """Shares of what was counted, of reports that were sent.

    Args:
        hits: how many of them were, by device and slot.
        all_: how many there were.
    """

    def __init__(self, hits: Array, all_: Array) -> None:
        self._hits, self._all = _summed(hits), _summed(all_)
        self._some = _summed((hits > 0).astype(float))
        with np.errstate(divide="ignore", invalid="ignore"):
            self.series = np.where(all_ > 0, hits / all_, np.nan)

    def change(self, before: Array, after: Array) -> Array:
        """Return the difference of the shares; a burst in one slot alone is none."""
        with np.errstate(divide="ignore", invalid="ignore"):
            low = self._hits[:, before] / self._all[:, before]
            high = (self._hits[:, -1:] - self._hits[:, after]) / (self._all[:, -1:] - self._all[:, after])
        often = self._some[:, -1:] - np.where(high > low, self._some[:, after], 0) >= threshold("odd_slots")
        fewest = threshold("odd_reports")
        told = (self._all[:, before] >= fewest) & (self._all[:, -1:] - self._all[:, after] >= fewest)
        good = told & self.enough(before, after)
        return np.where(good, np.where(often | (high <= low), high - low, 0.0), np.nan)

    def noise(self, _: Array) -> Array:
        """Return the standard deviation of the difference of two shares; what gets lost comes in bursts."""
        share = (self._hits[:, -1:] + 1) / (self._all[:, -1:] + 2)
        before = self._all[:, :-1]
        with np.errstate(divide="ignore"):
            found: Array = np.sqrt(
                threshold("odd_bursts") * share * (1 - share) * (1 / before + 1 / (self._all[:, -1:] - before))
            )
        return found


def _summed(by_slot: Array) -> Array:
    """Return sums over the slots before each, and over all of them at the end (axis 1)."""
    first = np.zeros_like(by_slot[:, :1])
    found: Array = np.concatenate((first, by_slot.cumsum(axis=1)), axis=1)
    return found
