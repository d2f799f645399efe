"""The losses of throttle of ESCs in a batch: where they are, and those that are told with it, together."""

from __future__ import annotations

from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dissectors.kit import breach
from dissectors.kit.order import spans
from dissectors.records import replace
from dissectors.tmotor.rules.joined.hold import Hold

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from dissectors.kit import Array, Occurrence, Occurrences, Pauses, Values, View
    from dissectors.tmotor.rules.joined.hold import Sample, Samples
    from dissectors.tmotor.rules.joined.joins import ReportingEsc
    from dissectors.tmotor.rules.joined.speed_reports import SpeedReports

_RULE = "BUS-017"
_CLOSE = (1, 9, 65)  # so many reports before a loss are looked at together: the last one with throttle is close
_LONGEST = 1 << 61  # times may be as far apart as there are any
RECENT = 6  # reports that show how often an ESC reports; a bus is silent if it misses two of them


class Stretches(NamedTuple):
    """Lost reports from `first` to before `stop`, since the same throttle at `since`, a row each.

    Those of the ESC stand by `known` further behind among its samples with earlier ones; there, `base` is the last one
    up to the throttle. `spare` is as `Hold` has it. `heard` says of a loss that would begin there whether others were
    heard for longer than the timeout.
    """

    first: Array
    stop: Array
    since: Array
    known: Array
    base: Array
    spare: Array
    heard: Array

    def take(self, rows: Array | slice) -> Stretches:
        """Return some of them."""
        return Stretches(*(column[rows] for column in self))

    def each(self, whole: Samples, k: int) -> list[Sample]:
        """Return the reports of one of them."""
        known = self.known.item(k)
        return whole.each(known + self.first.item(k), known + self.stop.item(k))


class Losses:
    """Which reports of some ESCs in a batch are `lost`: without a throttle as new as the timeout.

    Reports stand one ESC after the other, and those of a bus together. `stretches` has those since the same throttle,
    `esc` of which ESC each is, and `ends` where those of each ESC begin, and where the last ones end. `holding` marks
    the ones that go on from an earlier batch.

    Args:
        pauses: when nobody was heard.
        timeout: of throttle, in ns.
        bus: that of each ESC.
        ends: where the reports of each ESC begin, and where the last ones end.
        t: times of the reports, those of each ESC behind earlier ones of it.
        starts: where the times of each ESC begin, and where the last ones end.
        lost: a mask of the reports.
        since: the time of the last throttle before each.
        holds: the loss of each ESC that is not over.
    """

    def __init__(
        self, pauses: Pauses, timeout: int, bus: Array, ends: Array, t: Array, starts: Array, lost: Array,
        since: Array, holds: Sequence[Hold | None],
    ) -> None:  # fmt: skip
        self.lost = lost
        self._pauses, self._bus, self._t = pauses, bus, t
        begins = np.empty(len(lost) + 1, bool)
        begins[1:-1] = (lost[1:] != lost[:-1]) | (since[1:] != since[:-1])
        begins[ends] = True
        places = begins.nonzero()[0]
        some = lost[places[:-1]].nonzero()[0]
        first, stop = places[some], places[some + 1]
        self.esc = ends.searchsorted(first, "right") - 1
        self.ends = first.searchsorted(ends).tolist()
        known, start = (starts[1:] - ends[1:])[self.esc], starts[self.esc]
        spare, base = spares(t, known + first, start), bases(t, known + first, since[first], start)
        self.holding = np.zeros(len(some), bool)
        for hold, at, behind, begin in zip(holds, self.ends[:-1], self.ends[1:], ends[:-1].tolist(), strict=True):
            if hold is not None and at < behind and first[at] == begin and since[begin] == hold.since:
                spare[at], self.holding[at] = hold.spare, True
        self.stretches = Stretches(first, stop, since[first], known, base, spare, first)
        heard = self.lasted(first, np.arange(len(first)), timeout + 1)
        self.stretches = self.stretches._replace(heard=heard)

    def of(self, rows: Array) -> tuple[Array, Array]:
        """Return to which stretch each of some lost reports belongs, and to which ESC."""
        found = self.stretches.first.searchsorted(rows, "right") - 1
        return found, self.esc[found]

    def lasted(self, rows: Array, of: Array, least: int) -> Array:
        """Return of some lost reports, each of a stretch, whether the loss has lasted so many ns.

        Time in which nobody was heard is left out.
        """
        now = self.stretches.take(of)
        t = self._t[now.known + rows]
        left = t - now.since - least
        found: Array = left >= 0
        some = found.nonzero()[0]
        for bus, begin, end in spans(self._bus[self.esc[of[some]]]):
            at = some[begin:end]
            found[at] = ~self._pauses.last_for(left[at] + 1, bus, now.since[at], t[at], now.spare[at])
        return found


class ToldLosses:
    """Collects those of an ESC: losses of this batch are told together, those from earlier ones keep their place."""

    def __init__(self, view: View, unit: ReportingEsc, some: SpeedReports) -> None:
        self._view, self._unit, self._some = view, unit, some
        self._told: list[tuple[int, int, int, Callable[[], str]]] = []

    def tell(self, hold: Hold, course: Callable[[], str]) -> Iterator[Occurrence]:
        """Take a loss that is to be told; yield one that began earlier."""
        place, hold.place = hold.place, None
        if hold.rests or place is None:
            return
        if isinstance(place, int):
            self._told.append((place, hold.since, hold.last.t, course))
        else:
            yield told_later(hold, place, course())

    def add(self, losses: Iterable[tuple[int, int, int, int] | None], course: Callable[[int], str]) -> None:
        """Take losses that begin and end in this batch.

        Of each there is its place, the time of the throttle, that of its last report, and the number that `course`
        knows it by; None is no loss that is told.
        """
        self._told += [(*one[:3], partial(course, one[3])) for one in losses if one is not None]

    def occurrences(self) -> Iterator[Occurrences]:
        """Yield those of this batch."""
        if not self._told:
            return
        some = self._some
        places, since, last, told = map(list, zip(*self._told, strict=True))
        rows = some.rows[places]
        courses = dict(zip(rows.tolist(), told, strict=True))

        def values(row: int) -> Values:
            return {"channel": self._unit.index + 1, "course": courses[row]()}

        yield self._view.among_rows(
            _RULE, some.table, rows, values, drops=True, since=np.array(since),
            until=np.maximum(last, some.t[places]), key=np.zeros(len(rows), np.int64),
        )  # fmt: skip

    def kept(self, place: int, since: int) -> Occurrence:
        """Return a loss that is not told with its batch, as it may be told later."""
        values = {"channel": self._unit.index + 1}
        row = self._some.rows.item(place)
        return breach(self._view, self._some.table, row, _RULE, values, held=True, drops=True, since=since)


def told_later(hold: Hold, place: Occurrence, course: str) -> Occurrence:
    """Return a loss that began in an earlier batch."""
    return replace(place, values={**place.values, "course": course}, until=max(hold.last.t, place.t))


def opened(whole: Samples, losses: Stretches, k: int) -> Hold:
    """Return a loss that begins; reports behind its base belong to it."""
    at, base = losses.first.item(k) + losses.known.item(k), losses.base.item(k)
    hold = Hold(losses.since.item(k), whole.each(base, base + 1)[0], losses.spare.item(k))
    hold.feed(whole.each(base + 1, at))
    return hold


def bases(t: Array, at: Array, since: Array, start: Array) -> Array:
    """Return the last report up to the last throttle before each loss, which begins with the report `at`.

    The first report of its ESC is at `start`, which stands for one before.
    """
    found, left = start.copy(), np.arange(len(at))
    for begin, end in pairwise(_CLOSE):
        back = at[left, None] - np.arange(begin, end)
        earlier = (back >= start[left, None]) & (t[np.maximum(back, 0)] <= since[left, None])
        some = earlier.any(axis=1)
        found[left[some]] = at[left[some]] - begin - earlier[some].argmax(axis=1)
        left = left[~some & (back[:, -1] > start[left])]
    for k in left.tolist():
        before = (t[start[k] : at[k]] <= since[k]).nonzero()[0]
        found[k] = start[k] + before.item(-1) if len(before) else start[k]
    return found


def spares(t: Array, at: Array, start: Array) -> Array:
    """Return twice the usual time between the last reports before each of some: silences as short show nothing.

    The first report of its ESC is at `start`.
    """
    found = np.zeros(len(at), np.int64)
    many = at - start >= RECENT
    if many.any():
        before = t[at[many][:, None] + np.arange(-RECENT, 0)]
        found[many] = 2 * np.sort(before[:, 1:] - before[:, :-1], axis=1)[:, (RECENT - 1) // 2]
    for k in (~many).nonzero()[0].tolist():
        few = sorted(after - one for one, after in pairwise(t[start[k] : at[k]].tolist()))
        usual = int((few[len(few) // 2] + few[(len(few) - 1) // 2]) / 2) if few else 0
        found[k] = 2 * max(min(usual, _LONGEST), -_LONGEST)
    return found
