"""Reports at a steady pace, and where they stop."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.records import dataclass
from dissectors.times import NO_TIME, SECOND

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dissectors.kit.array import Array

MEMORY = 15  # periods that say what is usual
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
    """The reports of one sender.

    Args:
        least: shorter times than this in ns are no breaks.
        periods: nor are shorter ones than so many periods.
        fewest: reports that show a period.
        span: how long in ns they have to go on, so that they are more than a few in a row.
    """

    def __init__(self, least: int, periods: float, fewest: int, span: int = 0) -> None:
        self.least, self.periods, self.fewest, self.span = least, periods, fewest, span
        self.first = NO_TIME  # the first report since the last break
        self.t = np.empty(0, np.int64)  # since the pace changed last
        self.lost = np.empty(0, np.int64)
        self.usual = 0.0  # before that
        self._open: Break | None = None

    @property
    def last(self) -> int:
        """The time of the last report."""
        return int(self.t[-1]) if len(self.t) else NO_TIME

    def feed(self, times: Array, lost: Array) -> list[Break]:
        """Add reports, and how many were lost up to each; return the breaks between them."""
        return self.feed_all([self], [times], [lost])[0]

    @staticmethod
    def feed_all(senders: Sequence[PacedReports], times: Sequence[Array], lost: Sequence[Array]) -> list[list[Break]]:
        """Add reports of some senders, made with the same numbers; return the breaks of each."""
        some = [k for k, new in enumerate(times) if len(new)]
        found: list[list[Break]] = [[] for _ in senders]
        if some:
            reports = _Reports([senders[k] for k in some], [times[k] for k in some], [lost[k] for k in some])
            for k, breaks in zip(some, reports.breaks(), strict=True):
                found[k] = breaks
        return found

    def silence(self, now: int) -> Break | None:
        """Return the break that lasts until now, if there is one."""
        return self.silences([self], [now])[0]

    @staticmethod
    def silences(senders: Sequence[PacedReports], until: Sequence[int]) -> list[Break | None]:
        """Return the same of some senders, made with the same numbers, each up to its time."""
        found: list[Break | None] = [None] * len(senders)
        some = [k for k, now in enumerate(until) if now - senders[k].last > senders[k].least and len(senders[k].t)]
        if some:
            none = [np.empty(0, np.int64)] * len(some)
            usual = _Reports([senders[k] for k in some], none, none).usual()
            for k, period in zip(some, usual.tolist(), strict=True):
                found[k] = senders[k].silent(until[k], period)
        return found

    def silent(self, now: int, usual: float) -> Break | None:
        """Return the break that lasts until now if the period is the usual one, if there is one."""
        before = self._open
        slower = before.stop - before.start if before is not None and before.kept else 0
        longest = max(usual, slower) if slower <= _SLOWEST else usual
        if not usual or now - self.last <= max(self.least, self.periods * longest):
            return None
        return Break(self.last, now, usual, -1, lowered=False)

    def end(self, found: Break) -> None:
        """Begin anew behind a break."""
        self.first, self.usual, self._open = found.stop, found.period, found

    def settle(self, t: Array, lost: Array) -> None:
        """Tell by the report behind the one that ended a break whether the pace changed; these are the first."""
        one = self._open
        if one is None or len(t) < 2:
            return
        took, after = one.stop - one.start, int(t[1] - t[0])
        one.lowered = one.kept and bool(lost[1] == lost[0]) and took <= _ALIKE * after <= _ALIKE**2 * took
        if one.lowered:
            self.usual = float(took)
        self._open = None


class _Reports:
    """New reports of many senders, each with those before them that count: one sender after the other."""

    t: Array
    lost: Array
    start: Array
    stop: Array
    new: Array

    def __init__(self, senders: Sequence[PacedReports], times: Sequence[Array], lost: Sequence[Array]) -> None:
        self._senders = senders
        self.t = np.concatenate([part for one, new in zip(senders, times, strict=True) for part in (one.t, new)])
        self.lost = np.concatenate([part for one, new in zip(senders, lost, strict=True) for part in (one.lost, new)])
        old = np.array([len(one.t) for one in senders], np.int64)
        size = old + np.array([len(new) for new in times], np.int64)
        self.stop = np.cumsum(size)
        self.start = self.stop - size
        self.new = self.start + old
        self._of = np.repeat(np.arange(len(senders)), size)

    def breaks(self) -> list[list[Break]]:
        """Return the breaks of each sender."""
        found: list[list[Break]] = [[] for _ in self._senders]
        last = zip(np.maximum(self.new - 1, self.start).tolist(), self.start.tolist(), self.stop.tolist(), strict=True)
        for one, (at, start, stop) in zip(self._senders, last, strict=True):
            one.first = int(self.t[start]) if one.first == NO_TIME else one.first
            one.settle(self.t[at:stop], self.lost[at:stop])
        begin, ahead = self.start.copy(), np.full(len(self.start), _AHEAD)
        rows, short = self._long()
        while len(rows):
            of = self._of[rows]
            next_ = np.arange(len(rows)) - np.searchsorted(of, of) < ahead[of]
            broken, over = self._first_breaks(rows[next_], short[next_], begin), np.zeros(len(begin), bool)
            for row, period in broken:
                k = self._of.item(row)
                since, until, stop = self.t.item(row), self.t.item(row + 1), self.stop.item(k)
                kept = bool(self.lost[row + 1] == self.lost[row])
                found[k].append(Break(since, until, period, max(row - self.new.item(k), -1), kept))
                self._senders[k].end(found[k][-1])
                self._senders[k].settle(self.t[row + 1 : stop], self.lost[row + 1 : stop])
                begin[k], over[k] = row + 1, True
            ahead = np.where(over, _AHEAD, np.minimum(2 * ahead, _MOST_AHEAD))
            left = np.where(over[of], rows >= begin[of], ~next_)
            rows, short = rows[left], short[left]
        for one, *places in zip(self._senders, begin.tolist(), self.stop.tolist(), strict=True):
            here = slice(max(places[0], places[1] - MEMORY - 1), places[1])
            one.t, one.lost = self.t[here].copy(), self.lost[here].copy()
        return found

    def _first_breaks(self, rows: Array, short: Array, begin: Array) -> list[tuple[int, float]]:
        """Return the first break of each sender among some rows, and the period before it."""
        of, numbers = self._of[rows], self._senders[0]
        usual = self._usual(rows, begin[of], short)
        latest = np.maximum(self.t[rows], self.t[np.maximum(rows - 1, self.start[of])])  # one may be stamped too early
        limit = np.maximum(numbers.least, numbers.periods * usual)
        at = np.flatnonzero((usual != 0) & (self.t[rows + 1] - latest > limit))
        at = at[np.unique(of[at], return_index=True)[1]]
        return list(zip(rows[at].tolist(), usual[at].tolist(), strict=True))

    def _long(self) -> tuple[Array, Array]:
        """Return what may be breaks, and whether each is too short to be one behind many reports at a pace."""
        numbers, took = self._senders[0], np.diff(self.t, append=self.t[-1])
        took[self.stop - 1] = 0
        if not (took > numbers.least).any():  # mostly nobody pauses
            return np.zeros(0, np.int64), np.zeros(0, bool)
        of = self._of
        gone = np.diff(self.lost, append=self.lost[-1])
        gone[self.stop - 1] = 0
        single = took / (1 + gone)  # from one report to the next, lost or not
        single[self.stop - 1] = np.inf
        usual = np.array([one.usual for one in self._senders])
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
        numbers, of = self._senders[0], self._of[rows]
        first = np.array([one.first for one in self._senders], np.int64)[of]
        lasted = self.t[rows] - first >= numbers.span
        usual = np.array([one.usual for one in self._senders])[of]
        usual[short & lasted & (rows - begin >= MEMORY)] = 0.0
        asked = np.flatnonzero(lasted & ~(short & (rows - begin >= MEMORY)) & (rows - begin + 1 >= numbers.fewest))
        for at in range(0, len(asked), _AT_ONCE):
            some = asked[at : at + _AT_ONCE]
            usual[some] = _periods(self.t, self.lost, begin[some], rows[some], numbers.fewest)
        return usual
