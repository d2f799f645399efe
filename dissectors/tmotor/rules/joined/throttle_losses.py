"""The losses of throttle of an ESC in a batch: where they are, and those that are told with it, together."""

from __future__ import annotations

from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dissectors.kit import breach
from dissectors.records import replace
from dissectors.tmotor.rules.joined.hold import Hold

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from dissectors.kit import Array, Occurrence, Occurrences, Pauses, Values, View
    from dissectors.tmotor.rules.joined.hold import Samples
    from dissectors.tmotor.rules.joined.joins import ReportingEsc
    from dissectors.tmotor.rules.joined.speed_reports import SpeedReports

_RULE = "BUS-017"
_CLOSE = 64  # reports before a loss among which the last one with throttle is, mostly
_LONGEST = 1 << 61  # times may be as far apart as there are any
RECENT = 6  # reports that show how often an ESC reports; a bus is silent if it misses two of them


class Stretches(NamedTuple):
    """Reports from `first` to before `stop`, since the same throttle at `since`, a row each; `spare` as `Hold` has it.

    `heard` says of a loss that would begin there whether others were heard for so long.
    """

    first: Array
    stop: Array
    since: Array
    spare: Array
    heard: Array

    def take(self, rows: Array | slice) -> Stretches:
        """Return some of them."""
        return Stretches(*(column[rows] for column in self))


class Losses:
    """Which reports of an ESC in a batch are `lost`: without a throttle as new as the timeout, `since` its time.

    Args:
        pauses: when nobody was heard.
        bus: that of the reports.
        t: times of the reports, and of those before them.
        lost: the last of these.
        since: the time of the last throttle before each.
        hold: a loss that is not over.
    """

    def __init__(self, pauses: Pauses, bus: int, t: Array, lost: Array, since: Array, hold: Hold | None) -> None:
        self._pauses, self._bus = pauses, bus
        self._t, self._known = t, len(t) - len(lost)
        self.lost, self.since = lost, since
        self._first = np.append(0, np.flatnonzero((lost[1:] != lost[:-1]) | (since[1:] != since[:-1])) + 1)
        self._stop = np.append(self._first[1:], len(lost))
        self._spare = spares(t, self._known + self._first)
        if hold is not None and lost[0] and since[0] == hold.since:
            self._spare[0] = hold.spare

    def stretches(self, least: int) -> Stretches:
        """Return them; a loss has to be heard for so many ns."""
        first, spare = self._first, self._spare
        heard = self.lost[first]
        heard[heard] = self._heard(first[heard], spare[heard], least)
        return Stretches(first, self._stop, self.since[first], spare, heard)

    def lasted(self, rows: Array, least: int) -> Array:
        """Return of some lost reports whether the loss has lasted so many ns, silence of the bus left out."""
        spare = self._spare[np.searchsorted(self._first, rows, "right") - 1]
        return self._heard(rows, spare, least)

    def _heard(self, rows: Array, spare: Array, least: int) -> Array:
        """Return whether a loss has lasted so many ns without the time in which nobody was heard."""
        t, since = self._t[self._known + rows], self.since[rows]
        left = t - since - least
        found: Array = left >= 0
        some = np.flatnonzero(found)
        silent = self._pauses.last_for(left[some] + 1, self._bus, since[some], t[some], spare[some])
        found[some] = ~silent
        return found


class ToldLosses:
    """Collects them: losses of this batch are told together, those from earlier ones keep where they began."""

    def __init__(self, view: View, unit: ReportingEsc, some: SpeedReports) -> None:
        self._view, self._unit, self._some = view, unit, some
        self._told: dict[int, tuple[int, int, Callable[[], str]]] = {}

    def tell(self, hold: Hold, course: Callable[[], str]) -> Iterator[Occurrence]:
        """Take a loss that is to be told; yield one that began earlier."""
        place, hold.place = hold.place, None
        if hold.rests or place is None:
            return
        if isinstance(place, int):
            self._told[place] = hold.since, hold.last.t, course
        else:
            yield told_later(hold, place, course())

    def add(self, losses: Stretches, last: Array, course: Callable[[int], str]) -> None:
        """Take losses that begin and end in this batch; `last` are times of their last reports."""
        columns = losses.first.tolist(), losses.since.tolist(), last.tolist()
        for k, (place, *times) in enumerate(zip(*columns, strict=True)):
            self._told[place] = *times, partial(course, k)

    def occurrences(self) -> Iterator[Occurrences]:
        """Yield those of this batch."""
        if not self._told:
            return
        told, some = self._told, self._some
        rows, t = some.rows[list(told)], some.t[list(told)]
        since, last = np.array([one[:2] for one in told.values()], np.int64).T
        courses = dict(zip(rows.tolist(), (one[2] for one in told.values()), strict=True))

        def values(row: int) -> Values:
            return {"channel": self._unit.index + 1, "course": courses[row]()}

        yield self._view.among_rows(
            _RULE, some.table, rows, values, drops=True, since=since, until=np.maximum(last, t),
            key=np.zeros(len(rows), np.int64),
        )  # fmt: skip

    def kept(self, place: int, since: int) -> Occurrence:
        """Return a loss that is not told with its batch, as it may be told later."""
        values = {"channel": self._unit.index + 1}
        row = self._some.rows.item(place)
        return breach(self._view, self._some.table, row, _RULE, values, held=True, drops=True, since=since)


def told_later(hold: Hold, place: Occurrence, course: str) -> Occurrence:
    """Return a loss that began in an earlier batch."""
    return replace(place, values={**place.values, "course": course}, until=max(hold.last.t, place.t))


def opened(whole: Samples, at: int, since: int, spare: int) -> Hold:
    """Return a loss that begins with the report `at`; those since the last throttle belong to it."""
    base = bases(whole.t, np.array([at]), np.array([since])).item(0)
    hold = Hold(since, whole.each(base, base + 1)[0], spare)
    hold.feed(whole.each(base + 1, at))
    return hold


def bases(t: Array, at: Array, since: Array) -> Array:
    """Return the last report up to the last throttle before each loss, which begins with the report `at`."""
    back = at[:, None] - np.arange(1, _CLOSE + 1)
    earlier = (back >= 0) & (t[np.maximum(back, 0)] <= since[:, None])
    found: Array = at - 1 - earlier.argmax(axis=1)
    for k in np.flatnonzero(~earlier.any(axis=1)).tolist():
        before = np.flatnonzero(t[: at[k]] <= since[k])
        found[k] = before.item(-1) if len(before) else 0
    return found


def spares(t: Array, at: Array) -> Array:
    """Return twice the usual time between the last reports before each of some: silences as short show nothing."""
    found = np.zeros(len(at), np.int64)
    many = at >= RECENT
    if many.any():
        before = t[at[many][:, None] + np.arange(-RECENT, 0)]
        found[many] = 2 * np.sort(before[:, 1:] - before[:, :-1], axis=1)[:, (RECENT - 1) // 2]
    for k in np.flatnonzero(~many).tolist():
        few = sorted(after - one for one, after in pairwise(t[: at[k]].tolist()))
        usual = int((few[len(few) // 2] + few[(len(few) - 1) // 2]) / 2) if few else 0
        found[k] = 2 * max(min(usual, _LONGEST), -_LONGEST)
    return found
