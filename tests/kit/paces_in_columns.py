"""Where reports at a steady pace break, found in columns: what the core finds one by one is to be the same."""

from __future__ import annotations

from operator import itemgetter
from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import NO_TIME, SECOND, Break
from kit.kept_reports import KEPT, MEMORY, KeptReports, NewReports

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dissectors.kit import Array

_ROUND = 16  # reports this many times closer than the longest period are one round
_MANY = 8  # rounds that may be as irregular as a bad bus makes them:
_MOSTLY, _SHORT, _LONG = 0.8, 0.65, 1.5  # so many periods lie within these shares of the usual one
_STRICT = 0.25  # what fewer rounds may be off
# At a steady pace a break is longer than so many times what this many of the last periods, and one, do not exceed.
_FAR, _COMMON = 3, 8
_ALIKE = 2.5  # times that another pace may be off
_SLOWEST = 5 * SECOND // 2  # a longer time is no pace before it is seen twice
# Times of a sender that may be breaks and are looked at together, twice as many if none is: behind one it begins anew.
_AHEAD, _MOST_AHEAD = 4, 1 << 10
_TOGETHER = 1 << 11  # times of all senders that cost no more than fewer do
_AT_ONCE = 1 << 13  # windows whose periods are looked for together


def _periods(times: Array, lost: Array, fewest: int) -> Array:
    """Return the period of the reports of each window in ns, 0.0 if they are too few or not at a steady pace.

    A window is a column of times, of which the last `MEMORY` periods count; where it has fewer the first one is
    repeated. `lost` counts the reports that were lost up to each, which is why they may not be steady. Several that
    come close together, such as those of a sender with several indexes, are one round.
    """
    took = (times[1:] - times[:-1]).astype(np.float64)  # 0 in front of the window
    begins = took > took.max(axis=0) / _ROUND
    count = begins.sum(axis=0)
    before = _before(begins)
    rounds = np.where(begins, times[1:] - times.ravel().take(before), np.inf)
    found = _steady(rounds, count)
    missed = np.flatnonzero((found == 0) & (lost[-1] > lost[0]))
    if len(missed):
        gone = np.where(begins, lost[1:] - lost.ravel().take(before), 0.0)[:, missed]
        found[missed] = _steady(rounds[:, missed] / (1 + gone), count[missed])
    found[count + 1 < max(fewest, 2)] = 0.0
    return found


def _before(begins: Array) -> Array:
    """Return of each place in a window, a row each, where the round in front of it began, as places in all windows."""
    count, windows = begins.shape
    last = np.zeros(begins.shape, np.int64)
    np.multiply(begins[:-1], np.arange(windows, count * windows, windows)[:, None], out=last[1:])
    np.maximum.accumulate(last, axis=0, out=last)
    last += np.arange(windows)
    return last


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
        self.kept = KeptReports()  # since then
        self._open: dict[int, Break] = {}

    @property
    def last(self) -> Array:
        """The time of the last report of each."""
        return self.kept.last

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
        new = NewReports(senders, size, t, lost)
        begun = self.first[senders]
        self.first[senders] = np.where(begun == NO_TIME, t[new.start], begun)
        self._settle_waiting(new)
        some = self._may_break(new)
        if not len(some):
            self.kept.add(new)
            return []
        asked, others = new.split(some)
        found = _Reports(self, asked).breaks()
        if len(others.senders):
            self.kept.add(others)
        return [(some.item(k), one) for k, one in found]

    def _may_break(self, new: NewReports) -> Array:
        """Return the places of senders with what may be a break, as `_Reports` finds out: mostly nobody pauses.

        Their new reports are written down, if they are not too many.
        """
        kept, took = self.kept, self.kept.took(new)
        kept.write(new, many=False)
        may, long = np.zeros(len(new.senders), bool), np.flatnonzero(took > self.least)
        of = new.of[long]
        who, place = new.senders[of], long - new.start[of]
        lasted = new.t[long] - took[long] - self.first[who] >= self.span
        count = kept.count[who] + place
        paced = lasted & (count >= self.fewest)
        known = (self.usual[who] != 0) | (paced & (new.size[of] > KEPT))
        may[of[known]] = True
        asked = np.flatnonzero(paced & ~known)
        for at in range(0, len(asked), _AT_ONCE):
            some = asked[at : at + _AT_ONCE]
            usual = _periods(*kept.before(who[some], place[some], count[some]), self.fewest)
            may[of[some[(usual != 0) & (took[long[some]] > self.periods * usual)]]] = True
        return np.flatnonzero(may)

    def silences(self, until: Array) -> list[tuple[int, Break]]:
        """Return the breaks that last until now, each with its sender; `until` is that time for each of all."""
        some = np.flatnonzero((self.kept.count > 0) & (until - self.last > self.least))
        if not len(some):
            return []
        none = np.empty(0, np.int64)
        usual = _Reports(self, NewReports(some, np.zeros(len(some), np.int64), none, none)).usual()
        silent = [(k, self._silent(k, until.item(k), period)) for k, period in zip(some.tolist(), usual, strict=True)]
        return [(k, found) for k, found in silent if found is not None]

    def settle(self, sender: int, t: Sequence[int] | Array, lost: Sequence[int] | Array) -> None:
        """Tell by the report behind the one that ended a break whether the pace changed; these are the first."""
        one = self._open.get(sender)
        if one is None or len(t) < 2:
            return
        took, after = one.stop - one.start, int(t[1] - t[0])
        one.lowered = one.kept and bool(lost[1] == lost[0]) and took <= _ALIKE * after <= _ALIKE**2 * took
        if one.lowered:
            self.usual[sender] = took
        del self._open[sender]

    def _settle_waiting(self, new: NewReports) -> None:
        """Settle the breaks of which it was not known before these reports whether the pace changed."""
        if not self._open:
            return
        places = np.flatnonzero(np.isin(new.senders, list(self._open)))
        senders, first = new.senders[places], new.start[places]
        t, lost = self.kept.take(senders)
        columns = senders, t[:, -1], new.t[first], lost[:, -1], new.lost[first]
        for sender, last, since, before, gone in zip(*(column.tolist() for column in columns), strict=True):
            self.settle(sender, (last, since), (before, gone))

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
        more = count - len(self.first)
        if more > 0:
            self.first = np.append(self.first, np.full(more, NO_TIME))
            self.usual = np.append(self.usual, np.zeros(more))
            self.kept.make_room(more)


class _Reports:
    """New reports of many senders, each with those before them that count: one sender after the other."""

    def __init__(self, paced: PacedReports, new: NewReports) -> None:
        self._paced, self._senders, size = paced, new.senders, new.size
        old = paced.kept.count[new.senders]
        self.stop = np.cumsum(old + size)
        self.start = self.stop - size - old
        self.new = self.stop - size
        self._of = np.repeat(np.arange(len(old)), old + size)
        known = np.arange(KEPT) >= KEPT - old[:, None]
        fresh = np.repeat(np.tile((False, True), len(old)), np.stack((old, size), axis=1).ravel())
        self.t, self.lost = np.empty((2, len(fresh)), np.int64)
        columns = zip((self.t, self.lost), paced.kept.take(new.senders), (new.t, new.lost), strict=True)
        for column, before, more in columns:
            column[fresh], column[~fresh] = more, before[known]

    def breaks(self) -> list[tuple[int, Break]]:
        """Return the breaks of each sender, with its place."""
        paced, senders = self._paced, self._senders
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
        last = np.maximum(self.stop[:, None] + np.arange(-KEPT, 0), 0)
        paced.kept.put(senders, np.minimum(self.stop - begin, KEPT), self.t[last], self.lost[last])
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
            places = np.maximum(rows[some] + np.arange(-MEMORY, 1)[:, None], begin[some])
            usual[some] = _periods(self.t[places], self.lost[places], numbers.fewest)
        return usual
