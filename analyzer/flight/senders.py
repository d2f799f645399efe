"""Losses of senders: broken transfers and missing IDs of each node, by second."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from analyzer.decode.columns import senders
from analyzer.decode.grouped import grouped
from analyzer.flight.clock import RowPlaces
from analyzer.flight.thresholds import lasting
from analyzer.tables import STATUSES, TRANSFER_ANOMALIES, TRANSFER_IDS
from dissectors.kit.cells import numbers
from dissectors.times import NO_TIME, SECOND

if TYPE_CHECKING:
    from collections.abc import Collection

    from analyzer.decode.engine import Batch
    from analyzer.flight.clock import RecordedClock, Spot
    from dissectors.kit import Array

MOST_ENTRIES = 1 << 18
_NODES = 16  # bits of a bus and node below the second
_GAP = 1 << TRANSFER_ANOMALIES.index("transfer id gap")
_REPEATED = 1 << TRANSFER_ANOMALIES.index("transfer id repeated")
_BROKEN = np.array([name in {"bad crc", "interrupted", "timed out", "too short"} for name in STATUSES])

Node = tuple[int, int]  # bus, node


class CountsBySecond:
    """Counts by second and node; of more than `MOST_ENTRIES` nothing is told apart any more.

    Keys are a second and, in the lower 16 bits, a bus and node, as `decode.columns.senders` has them.
    """

    def __init__(self) -> None:
        self._keys: Array = np.empty(0, np.int64)
        self._counts: Array = np.empty(0, np.uint32)
        self._used = 0

    def add(self, keys: Array, counts: Array, came: Array) -> Array:
        """Add to keys, each once and in order; return the places of the new ones.

        If there is no room for all of these, those are taken that `came` first.
        """
        known = self._keys[: self._used]
        places = np.searchsorted(known, keys)
        old = places < self._used
        old[old] = known[places[old]] == keys[old]
        self._counts[places[old]] += counts[old].astype(np.uint32)
        new = np.flatnonzero(~old)
        room = max(0, MOST_ENTRIES - self._used)
        if len(new) > room:
            new = np.sort(new[np.argsort(came[new], kind="stable")[:room]])
        if len(new):
            self._insert(keys[new], counts[new].astype(np.uint32))
        return new

    def _insert(self, keys: Array, counts: Array) -> None:
        """Put new keys where they belong: mostly behind all others."""
        first, used = int(np.searchsorted(self._keys[: self._used], keys[0])), self._used + len(keys)
        keys = np.concatenate((self._keys[first : self._used], keys))
        counts = np.concatenate((self._counts[first : self._used], counts))
        order = np.argsort(keys, kind="stable")
        if used > len(self._keys):
            wide = used + used // 4
            self._keys, self._counts = (np.resize(one, wide) for one in (self._keys, self._counts))
        self._keys[first:used], self._counts[first:used] = keys[order], counts[order]
        self._used = used

    def between(self, first: int, last: int) -> tuple[Array, Array]:
        """Return the nodes that have a count in a second from the first to the last, and the counts."""
        borders = np.array([first << _NODES, max(first, last + 1) << _NODES], np.int64)
        start, stop = np.searchsorted(self._keys[: self._used], borders).tolist()
        return self._keys[start:stop] & ((1 << _NODES) - 1), self._counts[start:stop]

    def alone(self, keys: Array) -> Array:
        """Return a mask of the keys that stand alone in their second, each of which has a count."""
        known, seconds = self._keys[: self._used], keys >> _NODES
        start, stop = (np.searchsorted(known, border << _NODES) for border in (seconds, seconds + 1))
        found: Array = stop - start == 1
        return found


class LossesBySecond:
    """Adds up batches, with the bounds of `CountsBySecond`; the `clock` is fed before."""

    def __init__(self, clock: RecordedClock) -> None:
        self._clock = clock
        self._broken, self._missing, self._repeated = CountsBySecond(), CountsBySecond(), CountsBySecond()
        # Where the first ID of a second was left out, of seconds in which IDs of one node alone were, and their keys.
        self._jumps, self._jumped = np.empty(0, np.int64), RowPlaces(*(np.empty(0, np.int64),) * 5)
        self.transfers = 0

    def feed(self, batch: Batch) -> None:
        """Add the next batch."""
        transfers, at = batch.transfers, self._clock.transfers
        self.transfers += len(transfers)
        anomaly, status = numbers(transfers.column("anomaly")), numbers(transfers.column("status"))
        timed = at.t != NO_TIME
        gaps = np.flatnonzero((anomaly & _GAP != 0) & timed)
        again = np.flatnonzero((anomaly & _REPEATED != 0) & timed)
        broken = np.flatnonzero(_BROKEN[status] & timed)
        if not len(gaps) and not len(again) and not len(broken):
            return
        node = senders(transfers)
        left_out = (numbers(transfers.column("step"))[gaps].astype(np.int64) - 1) % TRANSFER_IDS
        keys, rows = self._add(self._missing, node, gaps, left_out)
        self._note_jumps(keys, rows)
        for kept, some in ((self._repeated, again), (self._broken, broken)):
            self._add(kept, node, some, np.ones_like(some))

    def _add(self, kept: CountsBySecond, node: Array, rows: Array, much: Array) -> tuple[Array, Array]:
        """Add so much of some transfers; return the new keys, and the first row of each."""
        if not len(rows):
            return rows, rows
        keys = self._second(self._clock.transfers.ran[rows]) << _NODES | node[rows]
        base = keys.min()
        order, begins = grouped(keys - base)
        firsts = order[begins]
        new = kept.add(keys[firsts], np.add.reduceat(much[order], begins), firsts)
        return keys[firsts[new]], rows[firsts[new]]

    def _note_jumps(self, keys: Array, rows: Array) -> None:
        """Keep where IDs were left out, of new keys that are alone in their second as far as is known."""
        alone = self._missing.alone(keys)
        if alone.any():
            self._jumps = np.concatenate((self._jumps, keys[alone]))
            self._jumped = self._jumped.followed_by(self._clock.transfers.take(rows[alone]))

    def broken(self, start: int, stop: int, nodes: Collection[Node] | None = None) -> int:
        """Return how many transfers of some nodes, or of all, were not whole in a time."""
        return self._sum(self._broken, start, stop, nodes)

    def most_broken(self, start: int, stop: int) -> tuple[Node, int] | None:
        """Return whose transfers were not whole most often in a time, and how many these are; None if all were."""
        codes, counts = self._between(self._broken, start, stop)
        if not len(codes):
            return None
        sums = np.bincount(codes, counts)
        code = int(np.flatnonzero(sums == sums.max())[-1])
        return (code >> 8, code & 0xFF), int(sums[code])

    def missing(self, start: int, stop: int, nodes: Collection[Node] | None = None) -> int:
        """Return how many transfer IDs of some nodes, or of all, were left out in a time."""
        return self._sum(self._missing, start, stop, nodes)

    def since(self, node: Node, until: Spot) -> Spot | None:
        """Return since when IDs of a node alone are left out again and again, up to a time; None if they are not."""
        last, pause = int(self._second(until.ran)), lasting("harmless") // SECOND
        found, code = None, _code(node)
        for second in range(last, last - lasting("looked_back") // SECOND, -1):
            rows = np.flatnonzero(self._jumps == second << _NODES | code)
            alone = len(rows) > 0 and bool(self._missing.alone(self._jumps[rows]).all())
            spot = self._jumped.at(int(rows[0])) if alone else None
            if spot is not None and spot.ran <= until.ran:
                found, last = spot, second
            elif last - second > pause:
                break
        return found

    def repeated(self, start: int, stop: int, nodes: Collection[Node] | None = None) -> int:
        """Return how many transfers of some nodes, or of all, had the ID of the one before, and said something else."""
        return self._sum(self._repeated, start, stop, nodes)

    def _second(self, ran: Any) -> Any:
        """Return the second in which a time is, or those of several."""
        return (ran - (self._clock.start or 0)) // SECOND

    def _between(self, kept: CountsBySecond, start: int, stop: int) -> tuple[Array, Array]:
        return kept.between(self._second(start), self._second(stop))

    def _sum(self, kept: CountsBySecond, start: int, stop: int, nodes: Collection[Node] | None) -> int:
        codes, counts = self._between(kept, start, stop)
        some = slice(None) if nodes is None else np.isin(codes, [_code(node) for node in nodes])
        return int(counts[some].sum(dtype=np.int64))


def _code(node: Node) -> int:
    """Return a node as `decode.columns.senders` has it."""
    return node[0] << 8 | node[1]
