"""The commands of a vehicle as a pulse: how far apart they are, how high and low, how many, in steps of 20 ms."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.flight.thresholds import threshold
from dissectors.kit.order import changes, steps
from dissectors.times import MILLISECOND, SECOND

if TYPE_CHECKING:
    from analyzer.flight.clock import RecordedClock
    from analyzer.flight.orders import CommandReader, Commands
    from dissectors.kit import Array

STEP = 20 * MILLISECOND
MOST_STEPS = 1 << 22  # 23 hours
_MOST_PERCENT = 255


class CommandPulse:
    """Adds up batches, of the first `MOST_STEPS`; the `clock` and the `commands` are fed before.

    Steps count from the start of the recording. What there is of several senders is the farthest apart, and the
    highest.
    """

    def __init__(self, clock: RecordedClock, commands: CommandReader) -> None:
        self._clock, self._commands = clock, commands
        self._spread = np.zeros(0, np.uint8)
        self._mean = np.zeros(0, np.uint8)
        self._room = np.zeros(0, np.uint8)  # from the lowest one up to `_MOST_PERCENT`
        self._count = np.zeros(0, np.uint16)
        self._pause = np.zeros(0, np.uint16)
        self._last: int | None = None
        self.channels = 0
        self._driven: dict[int, int] = {}  # when each channel, as people count them, was driven last

    def feed(self) -> None:
        """Add the commands of the batch."""
        for some in self._commands.now:
            ran = some.at.ran
            step = (ran - (self._clock.start or 0)) // STEP
            good = None if step.min() >= 0 and step.max() < MOST_STEPS else (step >= 0) & (step < MOST_STEPS)
            if good is not None and not good.any():
                continue
            self._grow(int(step.max() if good is None else step[good].max()) + 1)
            self.channels = max(self.channels, len(some.columns))
            self._note_driven(some)
            pause = steps(ran, ran[0] if self._last is None else self._last)
            self._last = int(ran[-1])
            mean = some.columns.mean(axis=0)
            if np.isnan(mean).any():
                mean = np.nanmean(some.columns, axis=0)
            values = [step, some.highest - some.lowest, mean, some.lowest, pause]
            if good is not None or pause[1:].min(initial=0) < 0:
                order = np.argsort(step, kind="stable")
                order = order if good is None else order[good[order]]
                values = [one[order] for one in values]
            step, spread, mean, lowest, pause = values
            starts = changes(step, step[0] - 1)
            at, count = step[starts], np.diff(np.append(starts, len(step)))
            most = (np.maximum.reduceat(one, starts) for one in (spread, mean))
            room = _MOST_PERCENT - np.minimum.reduceat(lowest, starts)
            for kept, new in zip((self._spread, self._mean, self._room), (*most, room), strict=True):
                high = np.ceil(np.clip(new, 0, _MOST_PERCENT)).astype(np.uint8)
                kept[at] = np.maximum(kept[at], high)
            longest = np.clip(np.maximum.reduceat(pause, starts) // MILLISECOND, 0, 65535).astype(np.uint16)
            self._pause[at] = np.maximum(self._pause[at], longest)
            self._count[at] += count.astype(np.uint16)

    def _note_driven(self, some: Commands) -> None:
        idle, ran = threshold("command_idle_percent"), some.at.ran
        last = some.columns[:, -1] > idle  # mostly so in flight: then no other row is asked
        for place, column in enumerate(some.columns):
            if last[place]:
                self._driven[place + some.plot.who.first] = int(ran[-1])
            elif len(driven := np.flatnonzero(column > idle)):
                self._driven[place + some.plot.who.first] = int(ran[driven[-1]])

    def spread(self, start: int, stop: int) -> Array:
        """Return how far apart they were in the steps of a time, in %; no step without a command."""
        rows = self._rows(start, stop)
        return self._spread[rows][self._count[rows] > 0]

    def mean(self, start: int, stop: int) -> Array:
        """Return how high they were in the mean of all channels, in %."""
        rows = self._rows(start, stop)
        return self._mean[rows][self._count[rows] > 0]

    def level(self, start: int, stop: int, least: float) -> Array:
        """Return where the mean is between the lowest channel, 0, and the highest, 1, in steps so far apart (%)."""
        rows = self._rows(start, stop)
        apart = self._spread[rows]
        some = (self._count[rows] > 0) & (apart >= max(least, 1))
        low = _MOST_PERCENT - self._room[rows][some].astype(np.int64)
        found: Array = (self._mean[rows][some] - low) / apart[some]
        return found

    def driven(self, since: int) -> set[int]:
        """Return which channels, as people count them, were commanded more than nothing since a time."""
        return {ch for ch, last in self._driven.items() if last >= since}

    def count(self, start: int, stop: int) -> int:
        """Return how many there were."""
        return int(self._count[self._rows(start, stop)].sum())

    def rate(self, start: int, stop: int) -> float:
        """Return how many there were in a second of the steps of a time."""
        found = self._count[self._rows(start, stop)]
        return float(found.sum()) * SECOND / (len(found) * STEP) if len(found) else 0.0

    def longest(self, start: int, stop: int) -> int:
        """Return the longest time without one, in ms, as far as it ended in this time."""
        found = self._pause[self._rows(start, stop)]
        return int(found.max()) if len(found) else 0

    def last_above(self, limit: float, start: int, stop: int) -> int | None:
        """Return the start of the last step in which they are farther apart than a limit, in %."""
        rows = self._rows(start, stop)
        found = np.flatnonzero(self._spread[rows] > limit)
        return None if not len(found) else (rows.start + int(found[-1])) * STEP + (self._clock.start or 0)

    def _rows(self, start: int, stop: int) -> slice:
        base = self._clock.start or 0
        first = max(0, (start - base) // STEP)
        return slice(first, max(first, min(len(self._count), -(-(stop - base) // STEP))))

    def _grow(self, count: int) -> None:
        if count > len(self._count):
            wide = max(count, min(2 * len(self._count), MOST_STEPS), 1024)
            for name in ("_spread", "_mean", "_room", "_count", "_pause"):
                old: Array = getattr(self, name)
                setattr(self, name, np.concatenate((old, np.zeros(wide - len(old), old.dtype))))
