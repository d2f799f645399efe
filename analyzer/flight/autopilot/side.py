"""Measurements of an autopilot's own log in the time of a capture: its outputs, the reports it got, its battery."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.flight.autopilot.track import Signal, outputs
from analyzer.flight.thresholds import threshold
from dissectors.records import dataclass
from dissectors.times import MICROSECOND, SECOND

if TYPE_CHECKING:
    from analyzer.flight.autopilot.alignment import Alignment
    from analyzer.sources.dataflash import AutopilotLog
    from dissectors.kit import Array

_REPORTS, _SUPPLIES = "ESC", ("BAT", "CURR")


@dataclass(frozen=True, slots=True)
class AutopilotSide:
    """All times are in ns, ascending; `error` is how far off they may be.

    `outputs` are the recorded times of its records of outputs, by which is known where the log begins and ends,
    `driven` how far these are up in their range, from 0 to 1, in the mean of the motors. `supply` are recorded times
    and volts of its first battery monitor. `reports` are the times by the capture's clock, holes of the recording and
    all, at which it logged a report of an ESC, by channel.
    """

    error: int
    outputs: Array
    driven: Array
    reports: dict[int, Array]
    supply: tuple[Array, Array]

    @property
    def began(self) -> int:
        """Where the log begins."""
        return int(self.outputs[0])

    @property
    def ended(self) -> int:
        """Where it ends."""
        return int(self.outputs[-1])

    def covers(self, start: int, stop: int) -> bool:
        """Return whether the log was written all that time."""
        return self.began - self.error <= start and self.ended + self.error >= stop

    def heard(self, ch: int, start: int, stop: int) -> int | None:
        """Return how many reports of a channel it got in a time of the capture's clock; None if it never logs any."""
        times = self.reports.get(ch)
        return None if times is None else _count(times, start, stop)

    def heard_at_all(self, start: int, stop: int) -> int:
        """Return how many reports of any ESC it got in a time of the capture's clock."""
        return sum(_count(times, start, stop) for times in self.reports.values())

    def volts(self, start: int, stop: int) -> Array:
        """Return the voltages of its battery monitor in a time."""
        times, volts = self.supply
        return volts[slice(*np.searchsorted(times, [start, stop]))]

    def drive(self, start: int, stop: int) -> Array:
        """Return how far its outputs were up in a time."""
        return self.driven[slice(*np.searchsorted(self.outputs, [start, stop]))]


def side_of(log: AutopilotLog, alignment: Alignment) -> AutopilotSide | None:
    """Return what a log measured, on the axis of a capture; None if its outputs do not say when it was written."""
    mine = outputs(log)
    if not len(mine) or not alignment.parts:
        return None
    _, times = alignment.placed(np.round(mine.time * SECOND / MICROSECOND).astype(np.int64))
    reports = log.table(_REPORTS)
    instance = reports.columns.get("Instance")
    heard: dict[int, Array] = {}
    if instance is not None and instance.dtype.kind in "iu":
        t, _ = alignment.placed(reports.time)
        heard = {int(ch) + 1: np.sort(t[instance == ch]) for ch in np.unique(instance)[: len(mine.values)]}
    error = max(part.error for part in alignment.parts)
    return AutopilotSide(error, times, _driven(mine), heard, _supply(log, alignment))


def _driven(mine: Signal) -> Array:
    """Return outputs as shares of the range that they move in, in the mean of all that move."""
    low, high = (edge(mine.values, axis=1)[:, None] for edge in (np.nanmin, np.nanmax))
    moving = (high - low)[:, 0] > threshold("output_moves_us")
    if not moving.any():
        return np.zeros(len(mine))
    found: Array = ((mine.values[moving] - low[moving]) / (high - low)[moving]).mean(axis=0)
    return found


def _supply(log: AutopilotLog, alignment: Alignment) -> tuple[Array, Array]:
    for name in _SUPPLIES:
        table = log.table(name)
        volts = table.columns.get("Volt")
        if volts is None or volts.dtype.kind != "f" or not len(table):
            continue
        which = next((table.columns[one] for one in ("Inst", "Instance") if one in table.columns), None)
        rows = np.isfinite(volts) if which is None else np.isfinite(volts) & (which == which.min())
        _, ran = alignment.placed(table.time[rows])
        order = np.argsort(ran, kind="stable")
        return ran[order], volts[rows][order]
    return np.zeros(0, np.int64), np.zeros(0)


def _count(times: Array, start: int, stop: int) -> int:
    low, high = np.searchsorted(times, [start, stop])
    return int(high - low)
