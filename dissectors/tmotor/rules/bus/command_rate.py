"""How often throttle is commanded."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dissectors.kit import MILLISECOND, NO_TIME, SECOND, Occurrence, Rule, breach, by_key
from dissectors.kit.order import steps
from dissectors.records import replace
from dissectors.tmotor.rules.joined.joins import commands
from dissectors.tmotor.rules.joined.periods import PeriodHistogram

if TYPE_CHECKING:
    from collections.abc import Iterable

    from dissectors.kit import Occurrences, View

MOST_SENDERS = 128
_MESSAGE = 0  # the kind of a transfer
_MIN_TO_SAY = 0.99


class _Sent(NamedTuple):
    """Commands of a node, and the times of the first and the last one."""

    transfers: int
    since: int
    until: int

    @property
    def period(self) -> float:
        """Return the mean time between two."""
        return (self.until - self.since) / (self.transfers - 1)


class CommandRate(Rule):
    """The rate of throttle commands of each node; the first 128 nodes."""

    rules = ("BUS-006",)

    def __init__(self) -> None:
        self._last: dict[tuple[int, int], int] = {}
        self._periods: dict[tuple[int, int], PeriodHistogram] = {}
        self._first: dict[tuple[int, int], Occurrence] = {}
        self._sent: dict[tuple[int, int], _Sent] = {}

    def feed(self, view: View) -> Iterable[Occurrences | Occurrence]:
        """Collect periods."""
        if view.start == NO_TIME:
            return
        self._count(view)
        for bus, sent in commands(view).items():
            order, first = by_key(sent.src)
            t = sent.t[order]
            apart = steps(t, t.item(0))
            for begin, stop in pairwise([*first.tolist(), len(t)]):
                row = order.item(begin)
                who = bus, sent.src.item(row)
                if who not in self._first:
                    if len(self._first) >= MOST_SENDERS:
                        continue
                    self._periods[who] = PeriodHistogram()
                    self._first[who] = breach(view, sent.table, sent.rows.item(row), "BUS-006", {}, held=True)
                if who in self._last:
                    apart[begin] = t[begin] - self._last[who]
                    self._periods[who].feed(apart[begin:stop])
                else:
                    self._periods[who].feed(apart[begin + 1 : stop])
                self._last[who] = t.item(stop - 1)
        yield from ()

    def _count(self, view: View) -> None:
        """Count all commands, broken ones too."""
        message, t = view.definition("RawCommand"), view.transfers
        if message is None:
            return
        rows = np.flatnonzero((t.type_id == message.type_id) & (t.kind == _MESSAGE) & (t.t != NO_TIME))
        order, first = by_key(t.bus[rows].astype(np.int64) << 7 | t.src[rows])
        if not len(rows):
            return
        rows = rows[order]
        times = t.t[rows]
        least, most = np.minimum.reduceat(times, first), np.maximum.reduceat(times, first)
        sizes, leads = np.diff(first, append=len(rows)), rows[first]
        columns = t.bus[leads], t.src[leads], sizes, least, most
        for bus, src, size, since, until in zip(*(column.tolist() for column in columns), strict=True):
            before = self._sent.get((bus, src), _Sent(0, since, until))
            if (bus, src) in self._sent or len(self._sent) < MOST_SENDERS:
                together = before.transfers + size, min(before.since, since), max(before.until, until)
                self._sent[bus, src] = _Sent(*together)

    def finish(self, view: View) -> Iterable[Occurrences | Occurrence]:
        """Compare rates; pauses change the mean alone, and commands in pairs the median alone."""
        nominal = view.number("BUS-006", "period_ms") * MILLISECOND
        tolerance = view.number("BUS-006", "tolerance_pct") / 100
        for who, periods in self._periods.items():
            if not periods.count or periods.count + 1 < view.number("BUS-006", "min_transfers"):
                continue
            median = periods.below(0.5)
            mean = self._sent[who].period or median
            if all(abs(period - nominal) > tolerance * nominal for period in (median, mean)):
                values = {"hertz": SECOND / mean, "slow_ms": periods.below(_MIN_TO_SAY) / MILLISECOND}
                yield replace(self._first[who], values=values)
