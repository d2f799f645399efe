"""How hard it was for senders to get onto a bus: its load, and its error frames."""

from __future__ import annotations

from bisect import bisect_right
from itertools import accumulate
from typing import TYPE_CHECKING

import numpy as np

from analyzer.rules.events import EventTimes, error_frames, when
from dissectors.kit import MILLISECOND, SECOND, times_by_bus
from dissectors.records import dataclass, field

if TYPE_CHECKING:
    from dissectors.kit import Array, BusTimes, View

STEP = 100 * MILLISECOND  # in which the load is measured
NEAR = SECOND // 2  # of an error frame
FULL = 0.85  # of the bit rate: beyond it senders wait longer than their messages are apart
_BIT_RATES = (125_000, 250_000, 500_000, 1_000_000)
_ROW = 16  # frames that follow each other as fast as the bus can carry them show its bit rate
_INEXACT = 1.1  # times of a recorder make it higher by so much
_MOST_ERRORS = 1 << 16


@dataclass(slots=True)
class _Step:
    """Bits in it, and the most bits a second in a row of frames that ended there."""

    bits: int = 0
    fastest: float = 0.0


@dataclass(slots=True)
class _Bus:
    """The last steps, the fastest row of frames before those, and times and bits of the last frames."""

    steps: dict[int, _Step] = field(default_factory=dict)
    fastest: float = 0.0
    ranked: tuple[list[int], list[float]] | None = None  # steps in order, and the most up to each; None if not known
    t: Array = field(default_factory=lambda: np.empty(0, np.int64))
    bits: Array = field(default_factory=lambda: np.empty(0, np.int64))

    def add(self, times: BusTimes, bits: Array) -> None:
        """Add frames."""
        self.ranked = None
        t, cuts = times.t, _cuts(times)
        sums = np.add.reduceat(bits, cuts, dtype=np.int64)
        fastest = np.maximum.reduceat(self._speeds(t, bits), cuts)
        for at, much, fast in zip((t[cuts] // STEP).tolist(), sums.tolist(), fastest.tolist(), strict=True):
            known = self.steps.setdefault(at, _Step())
            known.bits += much
            known.fastest = max(known.fastest, fast)

    def _speeds(self, t: Array, bits: Array) -> Array:
        """Return bits a second of the row of frames that each one ends, 0 while there are too few."""
        old = len(self.t)
        whole, much = np.concatenate((self.t, t)), np.concatenate((self.bits, bits.astype(np.int64)))
        self.t, self.bits = whole[-_ROW:].copy(), much[-_ROW:].copy()
        sent = np.cumsum(much)
        took = np.maximum(whole[_ROW:] - whole[:-_ROW], 1)
        speeds = np.zeros(len(whole))
        speeds[_ROW:] = (sent[_ROW:] - sent[:-_ROW]) * (SECOND / took)
        return speeds[old:]

    def forget(self, before: int) -> None:
        """Forget steps, but for how fast frames came in them."""
        for at in [step for step in self.steps if step < before]:
            self.fastest = max(self.fastest, self.steps.pop(at).fastest)
            self.ranked = None

    def bit_rate(self, last: int) -> int:
        """Return the usual bit rate that the frames up to a step need."""
        if self.ranked is None:
            order = sorted(self.steps)
            self.ranked = order, [*accumulate((self.steps[at].fastest for at in order), max, initial=self.fastest)]
        order, most = self.ranked
        fastest = most[bisect_right(order, last)]
        return next((rate for rate in _BIT_RATES if fastest <= _INEXACT * rate), _BIT_RATES[-1])


def _cuts(times: BusTimes) -> Array:
    """Return where frames of another step begin."""
    t = times.t
    first, last = int(t[0]) // STEP, int(t[-1]) // STEP
    if times.steady and last - first < len(t):
        cuts = np.searchsorted(t, np.arange(first, last + 1) * STEP)
        begins: Array = cuts[np.append(cuts[1:] > cuts[:-1], True)]
        return begins
    step = t // STEP
    return np.flatnonzero(np.diff(step, prepend=step[0] - 1))


class Strain:
    """Bits of each bus in steps, and times of error frames, of the last seconds."""

    def __init__(self) -> None:
        self._buses: dict[int, _Bus] = {}
        self._errors = EventTimes(_MOST_ERRORS)

    def feed(self, view: View, bits: Array) -> None:
        """Add a batch; `bits` are the `bit_times` of its frames."""
        for one in times_by_bus(view.frames):
            own = bits if one.rows is None else bits[one.rows]
            self._buses.setdefault(one.bus, _Bus()).add(one, own)
        for row, at, _ in error_frames(view):
            self._errors.add(at, when(view, row))

    def forget(self, before: int) -> None:
        """Forget what was before a time."""
        for bus in self._buses.values():
            bus.forget(before // STEP)
        self._errors.forget(before - NEAR)

    def on(self, bus: int, since: int, until: int, bit_rate: int | None) -> bool:
        """Return whether senders could not get through: error frames are near, or the bus was full."""
        if self._errors.near(bus, since - NEAR, until + NEAR):
            return True
        known = self._buses.get(bus)
        if known is None:
            return False
        first, last = since // STEP, until // STEP
        steps = range(first, last + 1) if last - first < len(known.steps) else known.steps
        bits = sum(known.steps[at].bits for at in steps if first <= at <= last and at in known.steps)
        return bits * SECOND >= FULL * (bit_rate or known.bit_rate(last)) * STEP * (last + 1 - first)
