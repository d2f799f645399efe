"""Gaps in transfer IDs behind which nothing is missing: of a counter for all types of a node, and of one begun anew.

The rules say so with all their evidence (TRF-019, TRF-020, BUS-010); this is what sums of a node need of it.
"""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.decode.grouped import grouped
from analyzer.tables import KINDS, TRANSFER_IDS
from dissectors.kit.cells import numbers
from dissectors.times import NO_TIME, SECOND

if TYPE_CHECKING:
    import pyarrow as pa

    from dissectors.kit import Array

MOST_SESSIONS = 8192  # whose counters are followed
_TOGETHER = 2 * SECOND  # in which two types of a node that are at 0 tell of a restart, as TRF-019 has it
_EARLY = 3  # times that a counter comes to 0 from the same ID: it wraps there
Node = tuple[int, int]  # bus, source
_MESSAGE = KINDS.index("message")


def sessions(transfers: pa.RecordBatch, rows: Array) -> Array:
    """Return for some transfers whose they are and of which type, as one number each."""
    names = ("bus", "src", "dst", "kind", "type_id")
    bus, src, dst, kind, type_id = (numbers(transfers.column(name))[rows].astype(np.int64) for name in names)
    found: Array = (bus << 16 | src << 8 | np.where(kind == _MESSAGE, 0, dst & 0xFF)) << 24 | kind << 16 | type_id
    return found


class CommonCounters:
    """Counts the messages of nodes as if all types had one counter, from the first batch with a gap of theirs on."""

    def __init__(self) -> None:
        self._followed: set[int] = set()
        self._latest: dict[int, tuple[int, int]] = {}  # node -> its last ID, and what was missing until then
        self._until: dict[int, int] = {}  # session -> what was missing until its last message

    def between(self, transfers: pa.RecordBatch, gaps: Array) -> Array:
        """Return what is missing before each of some messages since the one before of its type, by one counter.

        `gaps` are their rows, in order. What cannot be told is as many as there are IDs.
        """
        kind, bus, src = (numbers(transfers.column(name)).astype(np.int64) for name in ("kind", "bus", "src"))
        node = bus << 8 | src
        if len(self._followed) < MOST_SESSIONS:
            self._followed.update(np.unique(node[gaps]).tolist())
        followed = np.zeros(1 << 16, bool)
        followed[list(self._followed)] = True
        rows = np.flatnonzero((kind == _MESSAGE) & followed[node])
        t = numbers(transfers.column("t"))[rows]  # IDs are given at the start
        if (t[1:] < t[:-1]).any():
            rows = rows[np.argsort(t, kind="stable")]
        since = np.full(len(node), -1)
        if not len(rows):
            return np.full(len(gaps), TRANSFER_IDS)
        missing = np.zeros(len(node), np.int64)
        missing[rows] = self._missing(node[rows], numbers(transfers.column("transfer_id"))[rows].astype(np.int64))
        of = sessions(transfers, rows)
        order, begins = grouped(of)
        ordered = rows[order]
        since[ordered[1:]] = missing[ordered[1:]] - missing[ordered[:-1]]
        for one, row in zip(of[order[begins]].tolist(), ordered[begins].tolist(), strict=True):
            since[row] = missing[row] - self._until[one] if one in self._until else -1
        lasts = np.append(begins[1:], len(of)) - 1
        for one, row in zip(of[order[lasts]].tolist(), ordered[lasts].tolist(), strict=True):
            if one in self._until or len(self._until) < MOST_SESSIONS:
                self._until[one] = int(missing[row])
        # Messages that come in another order than that of their IDs leave out a whole round together, and nothing.
        return np.where(since[gaps] < 0, TRANSFER_IDS, since[gaps] % TRANSFER_IDS)

    def _missing(self, node: Array, ids: Array) -> Array:
        """Return how many IDs nodes have left out up to each message."""
        order, begins = grouped(node)
        ends = np.append(begins[1:], len(node))
        steps = np.zeros(len(node), np.int64)
        steps[1:] = (np.diff(ids[order]) - 1) % TRANSFER_IDS
        bases = np.zeros(len(begins), np.int64)
        for k, (code, first) in enumerate(zip(node[order[begins]].tolist(), ids[order[begins]].tolist(), strict=True)):
            before = self._latest.get(code)
            steps[begins[k]] = 0 if before is None else (first - before[0] - 1) % TRANSFER_IDS
            bases[k] = 0 if before is None else before[1]
        total = np.cumsum(steps)
        total += np.repeat(bases - (total[begins] - steps[begins]), ends - begins)
        for code, last in zip(node[order[begins]].tolist(), (ends - 1).tolist(), strict=True):
            self._latest[code] = int(ids[order[last]]), int(total[last])
        found = np.empty(len(node), np.int64)
        found[order] = total
        return found


class _Zero(NamedTuple):
    t: int
    session: int
    missing: int  # that were counted as lost


class ZeroedCounters:
    """Counters that fell to 0: `lost` is what they would have left out, but for restarts and early wraps."""

    def __init__(self) -> None:
        self.lost: defaultdict[Node, int] = defaultdict(int)
        self._latest: defaultdict[Node, list[_Zero]] = defaultdict(list)  # of each node, in the last seconds
        self._wraps: dict[int, tuple[int, int, int]] = {}  # session -> ID before, times in a row, counted as lost

    def follows(self, of: Array) -> Array:
        """Return which sessions may wrap early: all their gaps are to be fed."""
        return np.isin(of, list(self._wraps)) if self._wraps else np.zeros(len(of), bool)

    def feed(self, node: Node, session: int, t: int, before: int, missing: int) -> None:
        """Take a session that fell to 0 at `t`, from the ID `before`; another gap of it if `missing` is negative."""
        if missing < 0:
            self._wraps.pop(session, None)
            return
        recent = [one for one in self._latest[node] if t - one.t <= _TOGETHER] if t != NO_TIME else []
        others = [one for one in recent if one.session != session]
        if others:  # two witnesses of a restart: nothing is missing, of those before neither
            self.lost[node] -= sum(one.missing for one in others)
            recent = [one._replace(missing=0) if one in others else one for one in recent]
            missing = 0
        missing = self._wrapped(node, session, before, missing)
        if t != NO_TIME:
            self._latest[node] = [*recent, _Zero(t, session, missing)][-MOST_SESSIONS:]
        self.lost[node] += missing

    def _wrapped(self, node: Node, session: int, before: int, missing: int) -> int:
        """Return what is lost if this may be where a counter wraps that is shorter than it should be."""
        known, times, counted = self._wraps.get(session, (-1, 0, 0))
        times, counted = (times + 1, counted) if known == before else (1, 0)
        if times == _EARLY:
            self.lost[node] -= counted
            counted = 0
        if times >= _EARLY:
            missing = 0
        if session in self._wraps or len(self._wraps) < MOST_SESSIONS:
            self._wraps[session] = before, times, counted + missing
        return missing
