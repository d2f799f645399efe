"""The past of one ESC: speed and current that it had at commands that were held for a while."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.flight.thresholds import threshold

if TYPE_CHECKING:
    from dissectors.kit import Array

_BIN = 5  # % of command
_BINS = 41  # up to 200 %
_FEWEST = 4  # reports of a bin that counts
_NEAR = 2  # bins away
LAW = 3  # a current grows so with the speed: torque with its square, duty cycle with itself
_FIRST, _SHARE, _MOST = 16, 4, 1024  # a past is drawn after so many reports, then a quarter more, then every so many
_KEPT = 4096  # reports of a bin that weigh as much as all before


class Expected(NamedTuple):
    """What reports should say at a command: speed, current (NaN if unknown); `far` where it never had such a one."""

    speed: Array
    current: Array
    far: Array


class MotorPast:
    """Sums by bins of commands. What is expected of a report depends on how many came before, not on how they came."""

    def __init__(self) -> None:
        self._count = 0
        self._next = _FIRST
        self._sums = np.zeros((_BINS, 5))  # reports, command, speed for a volt, current, volts
        self._pending: list[tuple[Array, ...]] = []
        self._known: Array | None = None  # command, speed and current of the nearest bin of each, and how far it is

    def steps(self, count: int) -> list[int]:
        """Return into how many reports the next ones have to be cut: between them the past is drawn anew."""
        out, here, then = [], self._count, self._next
        while count:
            some = min(count, then - here)
            out.append(some)
            count, here = count - some, here + some
            if here == then:
                then = _then(then)
        return out

    def expected(self, command: Array, volts: Array) -> Expected | None:
        """Return what reports should say; None while there is no past."""
        if self._known is None:
            return None
        bins = np.clip(command / _BIN, 0, _BINS - 1).astype(np.int64)
        at, speed, current, usual, away = self._known[bins].T
        share = command / at
        # At the same command a lower voltage turns the motor slower: its torque falls with the square of the speed.
        return Expected(speed * volts * share, current * share**LAW * (volts / usual) ** 2, away > _NEAR)

    def add(self, command: Array, speed: Array, volts: Array, current: Array, calm: Array) -> None:
        """Take reports, of which those that are `calm` are as they should be."""
        self._count += len(command)
        rows = np.flatnonzero(calm)
        if len(rows):
            one, v = np.ones(len(rows)), volts[rows]
            self._pending.append((one, command[rows], speed[rows] / v, current[rows], v))
        if self._count >= self._next:
            self._next = _then(self._next)
            self._draw()

    def _draw(self) -> None:
        if not self._pending:
            return
        columns = [np.concatenate(parts) for parts in zip(*self._pending, strict=True)]
        self._pending = []
        bins = np.clip(columns[1] / _BIN, 0, _BINS - 1).astype(np.int64)
        for place, values in enumerate(columns):
            self._sums[:, place] += np.bincount(bins, values, _BINS)
        full = self._sums[:, 0] > _KEPT
        self._sums[full] /= 2
        good = np.flatnonzero(self._sums[:, 0] >= _FEWEST)
        if self._sums[:, 0].sum() < threshold("motor_learned") or not len(good):
            return
        means = self._sums[good, 1:] / self._sums[good, :1]
        away = np.abs(np.arange(_BINS)[:, None] - good[None, :])
        nearest = away.argmin(axis=1)
        self._known = np.column_stack((means[nearest], away.min(axis=1)))


def _then(count: int) -> int:
    """Return after how many reports the past is drawn again."""
    return count + min(max(_FIRST, count // _SHARE), _MOST)
