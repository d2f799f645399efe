"""Commands of the bus and outputs of the autopilot: throttles by time, to be compared with each other."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.devices.rows import usable
from analyzer.flight.orders import by_sender, orders
from analyzer.flight.reports import ReportEvents
from analyzer.flight.thresholds import lasting
from dissectors.records import dataclass
from dissectors.times import NO_TIME, SECOND

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analyzer.decode.engine import Batch
    from analyzer.flight.clock import RecordedClock
    from analyzer.flight.reports import EventOrder
    from analyzer.sources.dataflash import AutopilotLog
    from dissectors.kit import Array
    from dissectors.picture import Plot

MOST_COMMANDS = 1 << 21  # 90 minutes of 400 Hz; of more every second one is kept
MOST_PIECES = 8
MOST_SPAN = 86_400.0  # seconds that are compared
_BESIDE, _APART = 2, 10.0  # records on each side that tell whether a time is credible, and how far off it may be
MOST_CHANNELS = 14  # that a record of outputs has
OUTPUTS = "RCOU"


@dataclass(frozen=True, slots=True)
class Signal:
    """Throttles: a row a channel, a column a time; times in seconds, ascending, NaN where there is none."""

    time: Array
    values: Array

    def __len__(self) -> int:
        """Return how many times there are."""
        return len(self.time)


@dataclass(frozen=True, slots=True)
class ClockRun:
    """A stretch of a recording through which its clock runs on: from `start` to `end`, in ns of the capture's clock.

    `ran` is what is added to a time for recorded time; `commands` count seconds from `start`. `holes` are in it, from
    when to when nothing was recorded.
    """

    start: int
    end: int
    ran: int
    commands: Signal
    holes: Sequence[tuple[int, int]] = ()


class CommandTrack(ReportEvents):
    """Keeps the commands of the sender that sent the most. Bound: `MOST_COMMANDS` of each sender."""

    @staticmethod
    def of_use(plot: Plot) -> bool:
        """Return whether it commands."""
        return bool(plot.esc.commanded)

    def __init__(self, order: EventOrder) -> None:
        super().__init__(order)
        self._kept: dict[tuple[str, int], _Kept] = {}

    def feed(self, batch: Batch) -> None:
        """Add the next batch."""
        for plot in self._plots:
            if (table := batch.messages.get(plot.table)) is None:
                continue
            table = usable(table)
            found = orders(self._registry, plot, table)
            if found is None:
                continue
            at = self._clock.of(table)
            for key, mine in by_sender(found.sender, ~np.isnan(found.highest) & (at.t != NO_TIME)):
                one = self._kept.setdefault((plot.table, key), _Kept())
                one.add(at.t[mine], at.frame[mine], found.columns[:, mine])

    def pieces(self) -> list[ClockRun]:
        """Return the longest pieces of the recording, in order."""
        if not self._kept:
            return []
        t, frame, columns = max(self._kept.values(), key=lambda one: one.count).joined()
        found = [
            ClockRun(start, end, ran, _signal(t[first:last], columns[:, first:last], start), holes)
            for start, end, ran, first, last, holes in _stretches(self._clock, frame)
            if last > first
        ]
        longest = sorted(range(len(found)), key=lambda k: len(found[k].commands))[-MOST_PIECES:]
        return [found[k] for k in sorted(longest)]


class _Kept:
    """Commands of a sender, in parts as they came."""

    def __init__(self) -> None:
        self.count = 0
        self._parts: list[tuple[Array, Array, Array]] = []
        self._held = 0
        self._stride = 1

    def add(self, t: Array, frame: Array, columns: Array) -> None:
        """Take the next."""
        first = -self.count % self._stride
        self.count += len(t)
        part = t[first :: self._stride], frame[first :: self._stride], columns[:MOST_CHANNELS, first :: self._stride]
        self._parts.append(part)
        self._held += len(part[0])
        if self._held > MOST_COMMANDS:
            t, frame, columns = self.joined()
            self._parts = [(t[::2].copy(), frame[::2].copy(), columns[:, ::2].copy())]
            self._held, self._stride = len(self._parts[0][0]), 2 * self._stride

    def joined(self) -> tuple[Array, Array, Array]:
        """Return times, first frames and throttles, NaN where a command was shorter than others."""
        width = max(len(columns) for *_, columns in self._parts)
        room = [np.pad(c, ((0, width - len(c)), (0, 0)), constant_values=np.nan) for *_, c in self._parts]
        t, frame = (np.concatenate([part[k] for part in self._parts]) for k in (0, 1))
        return t, frame, np.concatenate(room, axis=1)


def _stretches(
    clock: RecordedClock, frame: Array
) -> Iterator[tuple[int, int, int, int, int, Sequence[tuple[int, int]]]]:
    """Yield the stretches through which the clock runs on.

    Start, end, shift, the commands from one to another, and the holes in it.
    """
    if clock.start is None or clock.last is None:
        return
    start, ran, shift, first = clock.start, 0, 0, 0
    holes: list[tuple[int, int]] = []
    for hole in clock.holes:
        shift -= hole.length
        if 0 <= hole.length <= lasting("clock_split"):
            holes.append((hole.t, hole.t_end))
            continue
        last = int(np.searchsorted(frame, hole.frame))
        yield start, hole.t, ran, first, last, holes
        start, ran, first, holes = hole.t_end, shift, last, []
    yield start, clock.last, ran, first, len(frame), holes


def _signal(t: Array, values: Array, start: int) -> Signal:
    order = np.argsort(t, kind="stable")
    order = order[t[order] <= start + MOST_SPAN * SECOND]
    return Signal((t[order] - start) / SECOND, values[:, order])


def outputs(log: AutopilotLog) -> Signal:
    """Return the outputs of the log, in microseconds of pulse; times are seconds since the autopilot started."""
    table = log.table(OUTPUTS)
    names = [name for k in range(1, MOST_CHANNELS + 1) if (name := f"C{k}") in table.columns]
    pulses = [table.columns[name].astype(np.float64) for name in names if table.columns[name].dtype.kind in "iu"]
    if not len(table) or not pulses:
        return Signal(np.zeros(0), np.zeros((0, 0)))
    rows = _credible(table.time / 1e6)
    return Signal(table.time[rows] / 1e6, np.array(pulses)[:, rows])


def _credible(time: Array) -> Array:
    """Return the rows whose times go on: records have no checksum, and one wrong time would hide all behind it."""
    around = np.pad(time, _BESIDE, mode="edge")
    usual = np.median(np.lib.stride_tricks.sliding_window_view(around, 2 * _BESIDE + 1), axis=1)
    near = (np.abs(time - usual) < _APART) & (np.abs(time - np.median(time)) < MOST_SPAN / 2)
    rows = np.flatnonzero(near)
    found: Array = rows[np.diff(np.maximum.accumulate(time[rows]), prepend=-1.0) > 0]  # each time once, none back
    return found
