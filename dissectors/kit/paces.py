"""Reports at a steady pace, and where they stop."""

from __future__ import annotations

from operator import itemgetter
from typing import TYPE_CHECKING

import numpy as np

from dissectors.records import dataclass
from dissectors.times import NO_TIME, SECOND

if TYPE_CHECKING:
    from dissectors.kit.array import Array

MEMORY = 15  # periods that say what is usual
_KEPT = MEMORY + 1  # reports, between which they are
_ROUND = 16  # reports this many times closer than the longest period are one round
_MANY = 8  # rounds that may be as irregular as a bad bus makes them:
_MOSTLY, _SHORT, _LONG = 0.8, 0.65, 1.5  # so many periods lie within these shares of the usual one
_STRICT = 0.25  # what fewer rounds may be off
# At a steady pace a break is longer than so many times what this many of the last periods, and one, do not exceed.
_FAR, _COMMON = 3, 8
_ALIKE = 2.5  # times that another pace may be off
_SLOWEST = 5 * SECOND // 2  # a longer time is no pace before it is seen twice
# By then a node has said that it restarted, and transfers without an end are given up.
_LATER = 5 * SECOND // 2
# Times of a sender that may be breaks and are looked at together, twice as many if none is: behind one it begins anew.
_AHEAD, _MOST_AHEAD = 4, 1 << 10
_TOGETHER = 1 << 11  # times of all senders that cost no more than fewer do
_AT_ONCE = 1 << 13  # windows whose periods are looked for together


def _periods(t: Array, lost: Array, first: Array, last: Array, fewest: int) -> Array:
    """Return the period of the reports of each window in ns, 0.0 if they are too few or not at a steady pace.

    Window `k` is from `first[k]` to `last[k]`, of which the last `MEMORY` periods count. `lost` counts the reports that
    were lost up to each, which is why they may not be steady. Several that come close together, such as those of a
    sender with several indexes, are one round.
    """
    at = np.maximum(last + np.arange(-MEMORY, 1)[:, None], first)  # a row each place in the window
    times = t[at]
    took = (times[1:] - times[:-1]).astype(np.float64)  # 0 in front of the window
    begins = took > took.max(axis=0) / _ROUND
    count = begins.sum(axis=0)
    rounds = _rounds(times, begins, np.inf)
    found = _steady(rounds, count)
    missed = np.flatnonzero((found == 0) & (lost[at[-1]] > lost[at[0]]))
    if len(missed):
        gone = _rounds(lost[at[:, missed]], begins[:, missed], 0.0)
        found[missed] = _steady(rounds[:, missed] / (1 + gone), count[missed])
    found[count + 1 < max(fewest, 2)] = 0.0
    return found


def _rounds(values: Array, begins: Array, rest: float) -> Array:
    """Return how far each round of a window goes, a row each place, a column each window; the rest begins none."""
    rounds, before = np.empty(begins.shape), values[0]
    for found, value, begin in zip(rounds, values[1:], begins, strict=True):
        found[:] = np.where(begin, value - before, rest)
        before = np.where(begin, value, before)
    return rounds


def _steady(rounds: Array, count: Array) -> Array:
    """Return the usual one of each column, which has `count`, 0.0 if they are not alike; infinity is none."""
    ranked, half = np.sort(np.ascontiguousarray(rounds.T), axis=1), count // 2
    rows = np.arange(len(ranked))
    usual: Array = (ranked[rows, half] + ranked[rows, count - half - 1]) / 2
    usual[count == 0] = 0.0
    off = _STRICT * usual
    alike = (usual - ranked[:, 0] <= off) & (ranked[rows, count - 1] - usual <= off)
    near = ((rounds >= _SHORT * usual) & (rounds <= _LONG * usual)).sum(axis=0)
    usual[~np.where(count < _MANY, alike, near >= _MOSTLY * count)] = 0.0
    return usual


@dataclass(slots=True, eq=False)
class Break:
    """A time without reports, from `start` to `stop`, of a sender that had a period.

    `at` is the report before it among those that were fed last, -1 for one before them. `kept` says that the IDs went
    on as if nothing was lost, `lowered` that the sender only reports less often from then on; None: not known yet.
    """

    start: int
    stop: int
    period: float
    at: int
    kept: bool = False
    lowered: bool | None = None

    def settled(self, now: int) -> bool:
        """Return whether it is known at a time what it is."""
        return self.lowered is not None or not self.kept or now - self.stop > _ALIKE * (self.stop - self.start)

    @property
    def told(self) -> int:
        """The time by which whatever explains it has been sent."""
        return self.stop + _LATER

    def due(self, now: int | None) -> bool:
        """Return whether it can be judged at a time: all is known that may explain it, or nothing follows (None)."""
        return now is None or (now > self.told and self.settled(now))

    def may_be_slower(self, now: int) -> bool:
        """Return whether a sender that only reports less often would have shown no more by then."""
        return bool(self.lowered) or (not self.settled(now) and self.stop - self.start <= _SLOWEST)


class PacedReports:
    """The reports of many senders, a row each: a row is there once reports of it are fed.

    Args:
        least: shorter times than this in ns are no breaks.
        periods: nor are shorter ones than so many periods.
        fewest: reports that show a period.
        span: how long in ns they have to go on, so that they are more than a few in a row.
    """

    def __init__(self, least: int, periods: float, fewest: int, span: int = 0) -> None:
        self.least, self.periods, self.fewest, self.span = least, periods, fewest, span
        self.first = np.empty(0, np.int64)  # the first report since the last break
        self.usual = np.empty(0)  # the period before the pace changed last
        # Reports since then, at most `_KEPT`: how many, and their times and losses, which end where a row ends.
        self.count = np.empty(0, np.int64)
        self.t = np.empty((0, _KEPT), np.int64)
        self.lost = np.empty((0, _KEPT), np.int64)
        self._open: dict[int, Break] = {}

    @property
    def last(self) -> Array:
        """The time of the last report of each."""
        found: Array = self.t[:, -1]
        return found

    def feed(self, senders: Array, size: Array, t: Array, lost: Array) -> list[tuple[int, Break]]:
        """Add reports of some senders, one sender after the other; return the breaks between them.

        Each comes with the place of its sender among these.

        Args:
            senders: each stands there once.
            size: how many reports of each there are, at least one.
            t: when they came.
            lost: how many were lost up to each.
        """
        if not len(senders):
            return []
        self._make_room(int(senders.max()) + 1)
        return _Reports(self, senders, size, t, lost).breaks()

    def silences(self, until: Array) -> list[tuple[int, Break]]:
        """Return the breaks that last until now, each with its sender; `until` is that time for each of all."""
        some = np.flatnonzero((self.count > 0) & (until - self.last > self.least))
        if not len(some):
            return []
        none = np.empty(0, np.int64)
        usual = _Reports(self, some, np.zeros(len(some), np.int64), none, none).usual()
        silent = [(k, self._silent(k, until.item(k), period)) for k, period in zip(some.tolist(), usual, strict=True)]
        return [(k, found) for k, found in silent if found is not None]

    def settle(self, sender: int, t: Array, lost: Array) -> None:
        """Tell by the report behind the one that ended a break whether the pace changed; these are the first."""
        one = self._open.get(sender)
        if one is None or len(t) < 2:
            return
        took, after = one.stop - one.start, int(t[1] - t[0])
        one.lowered = one.kept and bool(lost[1] == lost[0]) and took <= _ALIKE * after <= _ALIKE**2 * took
        if one.lowered:
            self.usual[sender] = took
        del self._open[sender]

    def waiting(self, senders: Array) -> list[int]:
        """Return the places of senders with a break of which it is not known whether the pace changed."""
        return [k for k, sender in enumerate(senders.tolist()) if sender in self._open] if self._open else []

    def end(self, sender: int, found: Break) -> None:
        """Begin anew behind a break."""
        self.first[sender], self.usual[sender], self._open[sender] = found.stop, found.period, found

    def _silent(self, sender: int, now: int, usual: float) -> Break | None:
        """Return the break that lasts until now if the period is the usual one, if there is one."""
        before, last = self._open.get(sender), self.last.item(sender)
        slower = before.stop - before.start if before is not None and before.kept else 0
        longest = max(usual, slower) if slower <= _SLOWEST else usual
        if not usual or now - last <= max(self.least, self.periods * longest):
            return None
        return Break(last, now, float(usual), -1, lowered=False)

    def _make_room(self, count: int) -> None:
        more = count - len(self.count)
        if more > 0:
            self.first = np.append(self.first, np.full(more, NO_TIME))
            self.usual = np.append(self.usual, np.zeros(more))
            self.count = np.append(self.count, np.zeros(more, np.int64))
            room = np.zeros((more, _KEPT), np.int64)
            self.t, self.lost = np.concatenate((self.t, room)), np.concatenate((self.lost, room))


class _Reports:
    """New reports of many senders, each with those before them that count: one sender after the other."""

    def __init__(self, paced: PacedReports, senders: Array, size: Array, t: Array, lost: Array) -> None:
        self._paced, self._senders = paced, senders
        old = paced.count[senders]
        self.stop = np.cumsum(old + size)
        self.start = self.stop - size - old
        self.new = self.stop - size
        self._of = np.repeat(np.arange(len(senders)), old + size)
        known = np.arange(_KEPT) >= _KEPT - old[:, None]
        fresh = np.repeat(np.tile((False, True), len(senders)), np.stack((old, size), axis=1).ravel())
        self.t, self.lost = np.empty((2, len(fresh)), np.int64)
        for column, before, new in ((self.t, paced.t, t), (self.lost, paced.lost, lost)):
            column[fresh], column[~fresh] = new, before[senders][known]

    def breaks(self) -> list[tuple[int, Break]]:
        """Return the breaks of each sender, with its place."""
        paced, senders = self._paced, self._senders
        begun = paced.first[senders]
        paced.first[senders] = np.where(begun == NO_TIME, self.t[self.start], begun)
        for k in paced.waiting(senders):
            here = slice(max(self.new.item(k) - 1, self.start.item(k)), self.stop.item(k))
            paced.settle(senders.item(k), self.t[here], self.lost[here])
        found: list[tuple[int, Break]] = []
        least = max(_AHEAD, min(_TOGETHER // len(self.start), _MOST_AHEAD))
        begin, ahead = self.start.copy(), np.full(len(self.start), least)
        rows, short = self._long()
        while len(rows):
            of = self._of[rows]
            next_ = np.arange(len(rows)) - np.searchsorted(of, of) < ahead[of]
            broken, over = self._first_breaks(rows[next_], short[next_], begin), np.zeros(len(begin), bool)
            for row, period in broken:
                k = self._of.item(row)
                since, until, stop = self.t.item(row), self.t.item(row + 1), self.stop.item(k)
                kept = bool(self.lost[row + 1] == self.lost[row])
                found.append((k, Break(since, until, period, max(row - self.new.item(k), -1), kept)))
                paced.end(senders.item(k), found[-1][1])
                paced.settle(senders.item(k), self.t[row + 1 : stop], self.lost[row + 1 : stop])
                begin[k], over[k] = row + 1, True
            ahead = np.where(over, least, np.minimum(2 * ahead, _MOST_AHEAD))
            left = np.where(over[of], rows >= begin[of], ~next_)
            rows, short = rows[left], short[left]
        paced.count[senders] = np.minimum(self.stop - begin, _KEPT)
        last = np.maximum(self.stop[:, None] + np.arange(-_KEPT, 0), 0)
        paced.t[senders], paced.lost[senders] = self.t[last], self.lost[last]
        return sorted(found, key=itemgetter(0))

    def _first_breaks(self, rows: Array, short: Array, begin: Array) -> list[tuple[int, float]]:
        """Return the first break of each sender among some rows, and the period before it."""
        of, numbers = self._of[rows], self._paced
        usual = self._usual(rows, begin[of], short)
        latest = np.maximum(self.t[rows], self.t[np.maximum(rows - 1, self.start[of])])  # one may be stamped too early
        limit = np.maximum(numbers.least, numbers.periods * usual)
        at = np.flatnonzero((usual != 0) & (self.t[rows + 1] - latest > limit))
        at = at[np.unique(of[at], return_index=True)[1]]
        return list(zip(rows[at].tolist(), usual[at].tolist(), strict=True))

    def _long(self) -> tuple[Array, Array]:
        """Return what may be breaks, and whether each is too short to be one behind many reports at a pace."""
        numbers, took = self._paced, np.diff(self.t, append=self.t[-1])
        took[self.stop - 1] = 0
        if not (took > numbers.least).any():  # mostly nobody pauses
            return np.zeros(0, np.int64), np.zeros(0, bool)
        of = self._of
        gone = np.diff(self.lost, append=self.lost[-1])
        gone[self.stop - 1] = 0
        single = took / (1 + gone)  # from one report to the next, lost or not
        single[self.stop - 1] = np.inf
        usual = numbers.usual[self._senders]
        shortest = np.minimum.reduceat(single, self.start)
        floor = np.maximum(numbers.least, numbers.periods * np.where(usual > 0, np.minimum(shortest, usual), shortest))
        far = (took > floor[of]) & (np.arange(len(took)) >= self.new[of] - 1)
        far[self.stop - 1] = False
        rows = np.flatnonzero(far)
        short = np.zeros(len(rows), bool)
        many = np.flatnonzero(rows - self.start[of[rows]] >= MEMORY)
        if len(many):
            before = np.lib.stride_tricks.sliding_window_view(single, MEMORY)[rows[many] - MEMORY]
            short[many] = took[rows[many]] <= _FAR * np.partition(before, _COMMON, axis=1)[:, _COMMON]
        return rows, short

    def usual(self) -> Array:
        """Return the period of each sender up to its last report, 0.0 without one."""
        return self._usual(self.stop - 1, self.start, np.zeros(len(self.stop), bool))

    def _usual(self, rows: Array, begin: Array, short: Array) -> Array:
        """Return the period before each row of the reports from `begin`, 0.0 without one.

        While they are few it is that from before the break; none if many go before a time behind it that is `short`.
        """
        numbers, who = self._paced, self._senders[self._of[rows]]
        lasted = self.t[rows] - numbers.first[who] >= numbers.span
        usual = numbers.usual[who]
        usual[short & lasted & (rows - begin >= MEMORY)] = 0.0
        asked = np.flatnonzero(lasted & ~(short & (rows - begin >= MEMORY)) & (rows - begin + 1 >= numbers.fewest))
        for at in range(0, len(asked), _AT_ONCE):
            some = asked[at : at + _AT_ONCE]
            usual[some] = _periods(self.t, self.lost, begin[some], rows[some], numbers.fewest)
        return usual
