"""Spans in which a motor is not as its past says: those that follow each other closely are one trouble."""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING

import numpy as np

from analyzer.flight.robust import middle, of_few
from analyzer.flight.thresholds import lasting, threshold
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analyzer.flight.clock import Spot
    from analyzer.flight.motors.watch import ComparedReports
    from dissectors.kit import Array

TOLD = 8  # reports by which it is told what happens
_FASTER, _LAW = 0.05, 3  # of its speed; the power of a propeller goes with the third power of the speed
_CERTAIN = 1 - 1e-9  # a power of numpy's may differ in its last digits


@dataclass(slots=True)
class MotorTrouble:
    """One trouble of a motor, from its `first` to its `last` report; `after` is the one behind it, None without one.

    `well` are the last reports before it that were well, each way. `speed`, `current` and `reported` are those of its
    first reports, as shares of the past and of the command; it is `sure` if one is far off. It has `count` reports.
    """

    first: Spot
    last: Spot
    after: Spot | None
    well: Sequence[Spot | None]
    speed: list[float]
    current: list[float]
    reported: list[float]
    count: int
    sure: bool

    @property
    def counts(self) -> bool:
        """False of a single report that is not far off, and of what is driven faster."""
        return (self.count > 1 or self.sure) and not self._driven_faster

    @property
    def _driven_faster(self) -> bool:
        """True if it just turns faster, with no more current than a propeller takes for that: it was learned slower."""
        speed, currents = of_few(self.speed), [share for share in self.current if isfinite(share)]
        return speed > 1 + _FASTER and bool(currents) and 1 <= of_few(currents) <= speed**_LAW


class TroubleSpans:
    """Follows the reports of one motor; `open` is a trouble that may go on, None without one."""

    def __init__(self) -> None:
        self.open: MotorTrouble | None = None
        self._last: Spot | None = None

    def feed(self, some: ComparedReports) -> Iterator[MotorTrouble]:
        """Take the next reports; yield the troubles that are over, as far as they may count."""
        if not len(some.at):
            return
        begins, goes_on = some.off[0], self.open is not None and self.open.after is None
        late = self._last is not None and some.at.at(0).ran - self._last.ran > lasting("silent_motor")
        if self.open is not None and goes_on and (late or not begins):
            self.open.after, goes_on = some.at.at(0), False
        rows = np.flatnonzero(some.off)
        if len(rows):
            yield from self._spans(some, rows, goes_on=goes_on)
        self._last = some.at.at(-1)

    def _spans(self, some: ComparedReports, rows: Array, *, goes_on: bool) -> Iterator[MotorTrouble]:
        """Take the rows that are off, the first of which belong to the open trouble if that `goes_on`."""
        ran, speed, current = some.at.ran[rows], some.speed[rows], some.current[rows]
        far = (speed < threshold("motor_once_slow")) | (current < threshold("motor_once_unloaded"))
        apart, next_ = np.diff(ran), np.diff(rows) == 1
        parts = (apart > lasting("motor_again")) & ~(next_ & (apart <= lasting("silent_motor")))
        borders = np.concatenate(([0], np.flatnonzero(parts) + 1, [len(rows)]))
        if self.open is not None and (goes_on or int(ran[0]) - self.open.last.ran <= lasting("motor_again")):
            _go_on(self.open, some, rows[: borders[1]], far)
            borders = borders[1:]
        if len(borders) == 1:
            return
        if self.open is not None:
            yield self.open
        begins, ends = borders[:-1], borders[1:]
        told = ((ends - begins > 1) | np.logical_or.reduceat(far, begins)) & ~_faster(speed, current, begins, ends)
        *over, last = np.flatnonzero(np.append(told[:-1], values=True)).tolist()
        for k in over:
            yield _trouble(some, rows[begins[k] : ends[k]], far[begins[k] : ends[k]])
        self.open = _trouble(some, rows[begins[last] : ends[last]], far[begins[last] : ends[last]])


def _trouble(some: ComparedReports, rows: Array, far: Array) -> MotorTrouble:
    first = int(rows[0])
    speed, current, reported = (column[rows[:TOLD]].tolist() for column in (some.speed, some.current, some.reported))
    last, after = _end(some, rows)
    return MotorTrouble(
        some.at.at(first), last, after, some.before(first), speed, current, reported, len(rows), bool(far.any())
    )  # fmt: skip


def _go_on(one: MotorTrouble, some: ComparedReports, rows: Array, far: Array) -> None:
    """Let a trouble have the next rows."""
    for mine, its in ((one.speed, some.speed), (one.current, some.current), (one.reported, some.reported)):
        mine.extend(its[rows[: max(0, TOLD - len(mine))]].tolist())
    one.last, one.after = _end(some, rows)
    one.count += len(rows)
    one.sure = one.sure or bool(far[: len(rows)].any())


def _end(some: ComparedReports, rows: Array) -> tuple[Spot, Spot | None]:
    last = int(rows[-1])
    return some.at.at(last), some.at.at(last + 1) if last + 1 < len(some.at) else None


def _faster(speed: Array, current: Array, begins: Array, ends: Array) -> Array:
    """Return which of some spans are of a motor that is driven faster, but for those of which that is not certain."""
    places = begins[:, None] + np.arange(TOLD)
    inside, places = places < ends[:, None], np.minimum(places, len(speed) - 1)
    speeds, currents = np.where(inside, speed[places], np.nan), current[places]
    known = (np.isnan(speeds) != inside).all(axis=1)
    with np.errstate(over="ignore"):
        fast, law = middle(speeds, 1), middle(speeds, 1) ** _LAW * _CERTAIN
    drawn = middle(np.where(inside & np.isfinite(currents), currents, np.nan), 1)
    found: Array = known & (fast > 1 + _FASTER) & (drawn >= 1) & (drawn <= law)
    return found
