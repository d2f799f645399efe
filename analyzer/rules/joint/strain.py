"""How hard it was for senders to get onto a bus: its load, and its error frames."""

from __future__ import annotations

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
_RATES = np.array(_BIT_RATES)
_LIMITS = _INEXACT * _RATES
_MOST_ERRORS = 1 << 16


@dataclass(slots=True)
class _Bus:
    """The last steps, the fastest row of frames before those, and times and bits of the last frames.

    Of each step, in their order: bits in it, and the most bits a second in a row of frames that ended there.
    """

    steps: Array = field(default_factory=lambda: np.empty(0, np.int64))
    sent: Array = field(default_factory=lambda: np.empty(0, np.int64))
    speed: Array = field(default_factory=lambda: np.empty(0))
    fastest: float = 0.0
    t: Array = field(default_factory=lambda: np.empty(0, np.int64))
    bits: Array = field(default_factory=lambda: np.empty(0, np.int64))

    def add(self, times: BusTimes, bits: Array) -> None:
        """Add frames."""
        t, cuts = times.t, _cuts(times)
        sums = np.add.reduceat(bits, cuts, dtype=np.int64)
        if self.fastest > _INEXACT * _BIT_RATES[-2]:  # the highest bit rate, whatever comes
            self.t, self.bits, speeds = t[:0], bits[:0], np.zeros(len(sums))
        else:
            speeds = np.maximum.reduceat(self._speeds(t, bits), cuts)
        steps = np.concatenate((self.steps, t[cuts] // STEP))
        order = np.argsort(steps, kind="stable")
        steps = steps[order]
        first = np.flatnonzero(np.append(True, steps[1:] != steps[:-1]))
        self.steps = steps[first]
        self.sent = np.add.reduceat(np.concatenate((self.sent, sums))[order], first)
        self.speed = np.maximum.reduceat(np.concatenate((self.speed, speeds))[order], first)

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
        gone = int(np.searchsorted(self.steps, before))
        self.fastest = float(self.speed[:gone].max(initial=self.fastest))
        self.steps, self.sent, self.speed = self.steps[gone:], self.sent[gone:], self.speed[gone:]

    def full(self, since: Array, until: Array, bit_rate: int | None) -> Array:
        """Return a mask of the times between two steps in which the bus was full."""
        sent = np.append(0, np.cumsum(self.sent))
        behind = np.searchsorted(self.steps, until, "right")
        bits = sent[behind] - sent[np.searchsorted(self.steps, since)]
        rate: int | Array = bit_rate or _RATES[self._needed()[behind]]
        found: Array = bits * float(SECOND) >= FULL * rate * STEP * (until + 1 - since)
        return found

    def _needed(self) -> Array:
        """Return which usual bit rate the frames before the first step need, and those up to each one."""
        fastest = np.maximum.accumulate(np.append(self.fastest, self.speed))
        return np.minimum(np.searchsorted(_LIMITS, fastest), len(_LIMITS) - 1)


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

    def on(self, bus: int, since: Array, until: Array, bit_rate: int | None) -> Array:
        """Return a mask of the times in which senders could not get through.

        Error frames are near, or the bus was full.
        """
        found = np.zeros(len(since), bool)
        if bus in self._buses:
            found |= self._buses[bus].full(since // STEP, until // STEP, bit_rate)
        if self._errors:
            times = zip((since - NEAR).tolist(), (until + NEAR).tolist(), strict=True)
            found |= np.array([self._errors.near(bus, *each) for each in times], bool)
        return found
