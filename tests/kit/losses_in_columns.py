"""Transfers that did not come, counted in columns: what the core counts row by row is to be the same."""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.decode.grouped import grouped
from analyzer.facts.losses import COMMON, FEWEST_COMMON, FEWEST_RETURNS, RETURNING
from analyzer.tables import KINDS, TRANSFER_ANOMALIES, TRANSFER_IDS
from dissectors.kit.cells import numbers, valid
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


_GAP, _TO_ZERO = (1 << TRANSFER_ANOMALIES.index(name) for name in ("transfer id gap", "transfer id restarted"))
_COUNTING = (KINDS.index("message"), KINDS.index("request"))  # a response has the transfer ID of its request
_BACK = TRANSFER_IDS - 3  # steps from here on are those of transfers that changed places with their neighbours
_AHEAD = TRANSFER_IDS + 1 - _BACK  # and up to here those of what they changed places with

# By node: lost; lost if one counter serves all its types, and whether it does or not; gaps, those that return from one,
# and sessions with gaps.
_COUNTS = ("lost", "common", "by_both", "gaps", "returns", "types")


class LossesInColumns:
    """Adds up gaps by node."""

    def __init__(self) -> None:
        self._counts = np.zeros((len(_COUNTS), 0), np.int64)  # as long as the highest node so far needs
        self._common_of = CommonCounters()
        self._known: set[int] = set()
        self._zeroed = ZeroedCounters()  # or their senders began anew
        self._before: dict[int, int] = {}  # of each session, the ID in front of its last gap

    def feed(self, transfers: pa.RecordBatch) -> None:
        """Count how far transfer IDs ran ahead of the transfers that came.

        What comes in another order runs ahead and falls back by as much.
        """
        anomaly = numbers(transfers.column("anomaly"))
        gaps = anomaly & (_GAP | _TO_ZERO) != 0
        if not gaps.any():
            return
        rows = np.flatnonzero(gaps & np.isin(numbers(transfers.column("kind")), _COUNTING))
        if not len(rows):
            return
        step, bus, src = (numbers(transfers.column(name))[rows].astype(np.int64) for name in ("step", "bus", "src"))
        missing = np.where(step >= _BACK, step - 1 - TRANSFER_IDS, (step - 1) % TRANSFER_IDS)
        to_zero = anomaly[rows] & _TO_ZERO != 0
        returns = self._returned(transfers, rows, step)
        of = sessions(transfers, rows)
        common = self._common_of.between(transfers, rows)
        first = self._first_of(of)
        fewer = np.where((common < missing) & ~first, common, 0)
        order, begins = grouped(node := bus << 8 | src)
        lost, either = np.where(to_zero, 0, missing), np.minimum(common, missing)
        counts = np.array((lost, fewer, either, np.ones_like(node), returns, first), np.int64)
        nodes = node[order[begins]]
        room = (int(nodes[-1]) | 0xFF) + 1 - self._counts.shape[1]
        if room > 0:
            self._counts = np.pad(self._counts, ((0, 0), (0, room)))
        self._counts[:, nodes] += np.add.reduceat(counts[:, order], begins, axis=1)
        asked = np.isin(of, of[to_zero]) | self._zeroed.follows(of)
        self._zero(transfers, *(some[asked] for some in (rows, of, np.where(to_zero, missing, -1))))

    def _count(self, name: str, at: Node) -> int:
        node = at[0] << 8 | at[1]
        return self._counts.item(_COUNTS.index(name), node) if node < self._counts.shape[1] else 0

    def _first_of(self, of: Array) -> Array:
        """Return which gaps are the first ones of their sessions: a counter may have become a common one just then."""
        first = np.zeros(len(of), bool)
        found, at = np.unique(of, return_index=True)
        first[at[[one not in self._known for one in found.tolist()]]] = True
        if len(self._known) < MOST_SESSIONS:
            self._known.update(found.tolist())
        return first

    def _zero(self, transfers: pa.RecordBatch, rows: Array, of: Array, missing: Array) -> None:
        """Take the gaps of sessions that fell to 0, and what is missing there; -1 for their other gaps.

        Of these only the first one after a fall ends what it began.
        """
        order, begins = grouped(of)
        falls = missing[order] >= 0
        telling = falls.copy()
        telling[1:] |= falls[:-1]
        telling[begins] = True
        kept = np.sort(order[telling])
        rows, of, missing = rows[kept], of[kept], missing[kept]
        names = ("bus", "src", "step", "transfer_id")
        bus, src, step, now = (numbers(transfers.column(name))[rows].astype(np.int64) for name in names)
        times = np.where(valid(transfers.column("t")), numbers(transfers.column("t")), NO_TIME)[rows]
        columns = bus, src, of, times, (now - step) % TRANSFER_IDS, missing
        for node_bus, node, *one in zip(*(column.tolist() for column in columns), strict=True):
            self._zeroed.feed((node_bus, node), *one)

    def shared(self, at: Node) -> bool:
        """Return whether two counters run under a node ID: what lies between them is not lost."""
        return self._count("returns", at) >= max(FEWEST_RETURNS, RETURNING * self._count("gaps", at))

    def lost(self, at: Node, *, began_anew: bool) -> int | None:
        """Return how many transfers of a node did not come; None if they cannot be counted.

        A node that `began_anew` begins with ID 0, and has lost nothing by that.
        """
        if self.shared(at):
            return None
        lost = max(0, self._count("lost", at) + (0 if began_anew else self._zeroed.lost[at]))
        types = self._count("types", at)
        one_counter = self._count("by_both", at) < lost * COMMON
        if types > 1 and self._count("gaps", at) >= FEWEST_COMMON and one_counter:
            return round(self._count("common", at) / types)  # a gap of the one counter is one of each type
        return lost

    def _returned(self, transfers: pa.RecordBatch, rows: Array, step: Array) -> Array:
        """Return at which gaps a counter goes on from where it was before the gap in front of this one."""
        names = ("bus", "src", "dst", "kind", "type_id", "transfer_id")
        bus, src, dst, kind, type_id, now = (numbers(transfers.column(n))[rows].astype(np.int64) for n in names)
        session = (bus << 16 | src << 8 | dst & 0xFF) << 24 | kind << 16 | type_id
        before = (now - step) % TRANSFER_IDS
        order, begins = grouped(session)
        past = np.full(len(rows), -1)
        past[order[1:]] = before[order[:-1]]
        firsts, lasts = order[begins], order[np.append(begins[1:], len(order)) - 1]
        past[firsts] = [self._before.get(one, -1) for one in session[firsts].tolist()]
        for one, at in zip(session[lasts].tolist(), before[lasts].tolist(), strict=True):
            if one in self._before or len(self._before) < MOST_SESSIONS:
                self._before[one] = at
        goes_on = (past >= 0) & (now == (past + 1) % TRANSFER_IDS)
        found: Array = goes_on & ((step == 0) | (step > _AHEAD) & (step < _BACK))
        return found
