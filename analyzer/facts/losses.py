"""Transfers that did not come, by the gaps in their IDs; of two counters under one node ID nobody can say how many."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.decode.grouped import grouped
from analyzer.facts.counters import MOST_SESSIONS, CommonCounters, Node, ZeroedCounters, sessions
from analyzer.tables import KINDS, TRANSFER_ANOMALIES, TRANSFER_IDS
from dissectors.kit.cells import numbers, valid
from dissectors.times import NO_TIME

if TYPE_CHECKING:
    import pyarrow as pa

    from dissectors.kit import Array

FEWEST_RETURNS = 4  # gaps behind which a counter goes on as if nothing had been there
RETURNING = 1 / 4  # of the gaps, at least: of lost transfers one in 32 looks like that by chance
FEWEST_COMMON = 8  # gaps of a node: of fewer chance makes it look so
COMMON = 1 / 4  # of the gaps, at most, that are left if one counter serves all types: by chance nearly all are
_GAP, _TO_ZERO = (1 << TRANSFER_ANOMALIES.index(name) for name in ("transfer id gap", "transfer id restarted"))
_COUNTING = (KINDS.index("message"), KINDS.index("request"))  # a response has the transfer ID of its request
_BACK = TRANSFER_IDS - 3  # steps from here on are those of transfers that changed places with their neighbours
_AHEAD = TRANSFER_IDS + 1 - _BACK  # and up to here those of what they changed places with

# By node: lost; lost if one counter serves all its types, and whether it does or not; gaps, those that return from one,
# and sessions with gaps.
_COUNTS = ("lost", "common", "by_both", "gaps", "returns", "types")


class LostTransfers:
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
