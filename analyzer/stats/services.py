"""`services`: requests and their responses, and how long answers take."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.rules.transfers.services import LATE, OPEN, REQUEST, RESPONSE
from analyzer.stats.distribution import Distribution
from analyzer.stats.statistic import Statistic
from analyzer.stats.table import StatColumn, StatTable
from analyzer.stats.traffic import type_of
from analyzer.tables import STATUSES
from dissectors.kit import TransferTable
from dissectors.records import dataclass, field
from dissectors.times import NO_TIME

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.stats.chosen import ChosenBatch
    from analyzer.stats.order import StatOrder
    from analyzer.stats.statistic import StatEnd
    from dissectors.kit import Array

COLUMNS = (
    StatColumn("bus", "Bus", "text"),
    StatColumn("client", "Client", "text"),
    StatColumn("server", "Server", "text"),
    StatColumn("type", "Type", "text"),
    StatColumn("requests", "Requests"),
    StatColumn("answered", "Answered", rank=2),
    StatColumn("unanswered", "Unanswered"),
    StatColumn("unasked", "Unasked", rank=1),
    StatColumn("min_ms", "Min", "number", 2),
    StatColumn("median_ms", "Median", "number", 2),
    StatColumn("p95_ms", "p95", "number", 2),
    StatColumn("max_ms", "Max", "number", 2, bar=True),
)
MOST_LINKS = 8192  # clients, servers and services; calls of others are left out
MOST_WAITING = 1 << 16  # transfers that wait for others, which matters only without times
_MS = 1_000_000
_WHOLE = [STATUSES.index(word) for word in ("ok", "unchecked", "bad crc")]  # a damaged answer has come, too


@dataclass(slots=True)
class _Link:
    """The calls of one client to one service of one server."""

    requests: int = 0
    answered: int = 0
    unasked: int = 0
    delays: Distribution = field(default_factory=Distribution)


class _Calls(NamedTuple):
    """Requests and responses as columns. `link` is bus, type, client and server, `call` that with the transfer ID."""

    call: Array
    kind: Array
    t: Array
    t_end: Array
    number: Array

    def take(self, rows: Array) -> _Calls:
        return _Calls(*(column[rows] for column in self))


class ServiceTable(Statistic):
    """Joins a response to the last request of its transfer ID, if that is at most 2 s older.

    A session may be held back until it is proven, so each transfer waits until none can come that began before it.
    """

    def __init__(self, _: StatOrder) -> None:
        self._links: dict[int, _Link] = {}
        none = np.zeros(0, np.int64)
        self._waiting = _Calls(none, none, none, none, none)  # not judged yet
        self._open = self._waiting  # the last request of each call, not answered yet
        self._now = NO_TIME

    def feed(self, batch: ChosenBatch) -> None:
        """Add the next batch."""
        t = TransferTable(batch.whole.transfers, 0)
        if not len(t):
            return
        self._now = max(self._now, int(t.t_end.max()))
        rows = np.flatnonzero((t.kind == REQUEST) | ((t.kind == RESPONSE) & np.isin(t.status, _WHOLE)))
        if len(rows):
            asks = t.kind[rows] == REQUEST
            src, dst = t.src[rows].astype(np.int64), t.dst[rows].astype(np.int64)
            client, server = np.where(asks, src, dst), np.where(asks, dst, src)
            link = t.bus[rows].astype(np.int64) << 24 | t.type_id[rows].astype(np.int64) << 16 | client << 8 | server
            lead = t.lead[rows].astype(np.int64)
            new = _Calls(link << 5 | t.transfer_id[rows], asks.astype(np.int64), t.t[rows], t.t_end[rows], lead)
            self._waiting = _joined(self._waiting, new)
        due = self._waiting.t < (self._now - LATE if self._now != NO_TIME else NO_TIME)
        due[: max(0, len(due) - MOST_WAITING)] = True
        if due.any():
            self._judge(self._waiting.take(np.flatnonzero(due)))
            self._waiting = self._waiting.take(np.flatnonzero(~due))

    def finish(self, end: StatEnd) -> Sequence[StatTable]:
        """Return the table, the busiest first."""
        self._judge(self._waiting)
        rows = []
        for code, link in sorted(self._links.items(), key=lambda item: (-item[1].requests, item[0])):
            bus, type_id, client, server = code >> 24, code >> 16 & 0xFF, code >> 8 & 0xFF, code & 0xFF
            delays = link.delays
            times = [delays.low, delays.quantile(0.5), delays.quantile(0.95), delays.high]
            ms = [time / _MS if delays.count and time is not None else None for time in times]
            rows.append((
                end.buses[bus], str(client), str(server), type_of(end.registry, REQUEST, type_id), link.requests,
                link.answered, link.requests - link.answered, link.unasked, *ms,
            ))  # fmt: skip
        links, counts = self._links.values(), ("requests", "answered", "unasked")
        sums = [sum(getattr(link, name) for link in links) for name in counts]
        total = (None, None, None, "all", sums[0], sums[1], sums[0] - sums[1], sums[2], None, None, None, None)
        about = "service calls; ms from the end of a request to the end of its response"
        return (StatTable("services", about, COLUMNS, rows, total=total),)

    def _judge(self, calls: _Calls) -> None:
        """Join requests and responses, in the order in which they began."""
        known = len(self._open.t)
        calls = _joined(self._open, calls)
        if not len(calls.t):
            return
        old = np.arange(len(calls.t)) < known
        order = np.lexsort((calls.number, calls.t, calls.call))
        calls, old = calls.take(order), old[order]
        asks = calls.kind == 1
        follows = np.zeros(len(order), bool)  # comes right behind a request of its call
        follows[1:] = asks[:-1] & (calls.call[1:] == calls.call[:-1])
        before = np.maximum(np.arange(len(order)) - 1, 0)
        soon = calls.t - calls.t[before] <= OPEN
        answers = ~asks & follows & soon
        for code in np.unique(calls.call >> 5).tolist():
            link = self._links.get(code)
            if link is None:
                if len(self._links) >= MOST_LINKS:
                    continue
                link = self._links[code] = _Link()
            here = calls.call >> 5 == code
            found = np.flatnonzero(here & answers)
            link.requests += int((here & asks & ~old).sum())
            link.answered += len(found)
            link.unasked += int((here & ~asks & ~answers).sum())
            timed = found[(calls.t_end[found] != NO_TIME) & (calls.t_end[before[found]] != NO_TIME)]
            link.delays.feed(calls.t_end[timed] - calls.t_end[before[timed]])
        answered = np.append(answers[1:], False)
        last = np.append(calls.call[1:] != calls.call[:-1], True)
        young = calls.t >= (self._now - LATE - OPEN if self._now != NO_TIME else NO_TIME)
        left = np.flatnonzero(asks & last & ~answered & young)
        self._open = calls.take(left[max(0, len(left) - MOST_WAITING) :])


def _joined(one: _Calls, other: _Calls) -> _Calls:
    return _Calls(*(np.concatenate(pair) for pair in zip(one, other, strict=True)))
