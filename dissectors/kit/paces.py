"""Reports at a steady pace, and where they stop."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from dissectors.records import dataclass
from dissectors.times import NO_TIME, SECOND

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

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


def period_of(times: Sequence[int], lost: Sequence[int], fewest: int) -> float:
    """Return the period of reports in ns, 0.0 if there are too few of them or they do not come at a steady pace.

    `lost` counts those that were lost up to each, which is why they may not. Several that come close together, such as
    those of a sender with several indexes, are one round.
    """
    if len(times) < max(fewest, 2):
        return 0.0
    took = [after - one for one, after in pairwise(times)]
    far = max(took) / _ROUND
    begin = [0, *(k for k, each in enumerate(took, 1) if each > far)]
    if len(begin) < max(fewest, 2):
        return 0.0
    rounds: list[float] = [times[after] - times[one] for one, after in pairwise(begin)]
    found = _steady(rounds)
    if not found and lost[-1] > lost[0]:
        gone = (1 + lost[after] - lost[one] for one, after in pairwise(begin))
        found = _steady([each / many for each, many in zip(rounds, gone, strict=True)])
    return found


def _steady(rounds: Sequence[float]) -> float:
    ranked, half = sorted(rounds), len(rounds) // 2
    usual = (ranked[half] + ranked[-half - 1]) / 2
    if len(rounds) < _MANY:
        steady = all(abs(each - usual) <= _STRICT * usual for each in rounds)
    else:
        steady = sum(_SHORT * usual <= each <= _LONG * usual for each in rounds) / len(rounds) >= _MOSTLY
    return usual if steady else 0.0


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
        self._least, self._periods, self._fewest, self._span = least, periods, fewest, span
        self._first = NO_TIME  # the first report since the last break
        self._t = np.empty(0, np.int64)  # since the pace changed last
        self._lost = np.empty(0, np.int64)
        self._usual = 0.0  # before that
        self._open: Break | None = None

    @property
    def last(self) -> int:
        """The time of the last report."""
        return int(self._t[-1]) if len(self._t) else NO_TIME

    def feed(self, times: Array, lost: Array) -> list[Break]:
        """Add reports, and how many were lost up to each; return the breaks between them."""
        old = len(self._t)
        t, lost = np.concatenate((self._t, times)), np.concatenate((self._lost, lost))
        took = np.diff(t)
        found: list[Break] = []
        begin, first = 0, max(old - 1, 0)
        if self._first == NO_TIME and len(t):
            self._first = int(t[0])
        self._settle(t, lost, first)
        far = len(took) > first and int(took[first:].max()) > self._least
        for k, at, short in self._long(t, took / (1 + np.diff(lost)), first) if far else ():
            if short and k - begin >= MEMORY and at - self._first >= self._span:
                continue
            here = slice(max(begin, k - MEMORY), k + 1)
            usual = self._period(t[here], lost[here])
            latest = int(t[max(k - 1, 0) : k + 1].max())  # one report may be stamped too early
            if usual and t[k + 1] - latest > max(self._least, self._periods * usual):
                kept = bool(lost[k + 1] == lost[k])
                found.append(Break(int(t[k]), int(t[k + 1]), usual, max(k - old, -1), kept))
                begin, self._usual, self._open = k + 1, usual, found[-1]
                self._first = found[-1].stop
                self._settle(t, lost, begin)
        begin = max(begin, len(t) - MEMORY - 1)
        self._t, self._lost = t[begin:].copy(), lost[begin:].copy()
        return found

    def silence(self, now: int) -> Break | None:
        """Return the break that lasts until now, if there is one."""
        usual = self._period(self._t, self._lost)
        before = self._open
        slower = before.stop - before.start if before is not None and before.kept else 0
        longest = max(usual, slower) if slower <= _SLOWEST else usual
        if not usual or now - self.last <= max(self._least, self._periods * longest):
            return None
        return Break(self.last, now, usual, -1, lowered=False)

    def _period(self, times: Array, lost: Array) -> float:
        """Return the period of the last reports, while they are few that from before the last break; 0.0 without."""
        lasted = len(times) >= self._fewest and int(times[-1]) - self._first >= self._span
        return period_of(times.tolist(), lost.tolist(), self._fewest) if lasted else self._usual

    def _long(self, t: Array, single: Array, first: int) -> Iterable[tuple[int, int, bool]]:
        """Return what may be breaks: row, time, and whether it is too short to be one behind many reports at a pace.

        `single` are the times from one report to the next, lost or not.
        """
        shortest = float(single.min())
        floor = max(self._least, self._periods * min(shortest, self._usual or shortest))
        took = np.diff(t)
        rows = np.flatnonzero(took[first:] > floor) + first
        if not len(rows):
            return ()
        short = np.zeros(len(rows), bool)
        if len(took) >= MEMORY:
            before = np.lib.stride_tricks.sliding_window_view(single, MEMORY)[np.maximum(rows - MEMORY, 0)]
            short = took[rows] <= _FAR * np.partition(before, _COMMON, axis=1)[:, _COMMON]
        return zip(rows.tolist(), t[rows].tolist(), short.tolist(), strict=True)

    def _settle(self, t: Array, lost: Array, at: int) -> None:
        """Tell by the report behind the one that ended a break whether the pace changed."""
        one = self._open
        if one is None or at + 1 >= len(t):
            return
        took, after = one.stop - one.start, int(t[at + 1] - t[at])
        one.lowered = one.kept and bool(lost[at + 1] == lost[at]) and took <= _ALIKE * after <= _ALIKE**2 * took
        if one.lowered:
            self._usual = float(took)
        self._open = None
