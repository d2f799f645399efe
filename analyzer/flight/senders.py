"""Losses of senders: broken transfers and missing IDs of each node, by second."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from analyzer.decode.columns import senders
from analyzer.decode.grouped import grouped
from analyzer.flight.thresholds import lasting
from analyzer.tables import STATUSES, TRANSFER_ANOMALIES, TRANSFER_IDS
from dissectors.kit.cells import numbers
from dissectors.times import NO_TIME, SECOND

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping

    from analyzer.decode.engine import Batch
    from analyzer.flight.clock import RecordedClock, Spot
    from dissectors.kit import Array

MOST_ENTRIES = 1 << 18
_GAP = 1 << TRANSFER_ANOMALIES.index("transfer id gap")
_REPEATED = 1 << TRANSFER_ANOMALIES.index("transfer id repeated")
_BROKEN = np.array([name in {"bad crc", "interrupted", "timed out", "too short"} for name in STATUSES])

Node = tuple[int, int]  # bus, node


class CountsBySecond:
    """Counts by second and node; of more than `MOST_ENTRIES` nothing is told apart any more."""

    def __init__(self) -> None:
        self.seconds: dict[int, dict[Node, int]] = {}
        self._entries = 0

    def add(self, node: Node, second: int, count: int) -> bool:
        """Add to one; return whether it is a new one."""
        of = self.seconds.get(second)
        if of is not None and node in of:
            of[node] += count
            return False
        if self._entries >= MOST_ENTRIES:
            return False
        self._entries += 1
        self.seconds.setdefault(second, {})[node] = count
        return True

    def between(self, first: int, last: int) -> Iterator[Mapping[Node, int]]:
        """Yield the counts of each second from the first to the last, in no order."""
        if last - first < len(self.seconds):
            yield from (self.seconds[second] for second in range(first, last + 1) if second in self.seconds)
        else:
            yield from (of for second, of in self.seconds.items() if first <= second <= last)


class LossesBySecond:
    """Adds up batches, with the bounds of `CountsBySecond`; the `clock` is fed before."""

    def __init__(self, clock: RecordedClock) -> None:
        self._clock = clock
        self._broken, self._missing, self._repeated = CountsBySecond(), CountsBySecond(), CountsBySecond()
        self._jumped: dict[tuple[Node, int], Spot] = {}  # where the first ID of a second was left out
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
        for rows, kept, much in (
            (gaps, self._missing, left_out), (again, self._repeated, np.ones_like(again)),
            (broken, self._broken, np.ones_like(broken)),
        ):  # fmt: skip
            new = {key: row for key, row, count in self._summed(node[rows], rows, much) if kept.add(*key, count)}
            if new and kept is self._missing:
                self._jumped.update(zip(new, at.spots(np.array(list(new.values()))), strict=True))

    def _summed(self, node: Array, rows: Array, much: Array) -> Iterator[tuple[tuple[Node, int], int, int]]:
        """Yield the nodes and seconds of some transfers as they come, with the first row of each, and the sum."""
        if not len(rows):
            return
        seconds = (self._clock.transfers.ran[rows] - (self._clock.start or 0)) // SECOND
        order, begins = grouped((seconds - seconds.min()) << 16 | node)
        firsts, sums = order[begins], np.add.reduceat(much[order], begins)
        place = np.argsort(firsts)
        first = firsts[place]
        columns = node[first], seconds[first], rows[first], sums[place]
        for code, second, row, count in zip(*(column.tolist() for column in columns), strict=True):
            yield ((code >> 8, code & 0xFF), second), row, count

    def broken(self, start: int, stop: int, nodes: Collection[Node] | None = None) -> int:
        """Return how many transfers of some nodes, or of all, were not whole in a time."""
        return self._sum(self._broken, start, stop, nodes)

    def most_broken(self, start: int, stop: int) -> tuple[Node, int] | None:
        """Return whose transfers were not whole most often in a time, and how many these are; None if all were."""
        found: Counter[Node] = Counter()
        for of in self._between(self._broken, start, stop):
            found.update(of)
        return max(found.items(), key=lambda one: (one[1], one[0])) if found else None

    def missing(self, start: int, stop: int, nodes: Collection[Node] | None = None) -> int:
        """Return how many transfer IDs of some nodes, or of all, were left out in a time."""
        return self._sum(self._missing, start, stop, nodes)

    def since(self, node: Node, until: Spot) -> Spot | None:
        """Return since when IDs of a node alone are left out again and again, up to a time; None if they are not."""
        last, pause = (until.ran - (self._clock.start or 0)) // SECOND, lasting("harmless") // SECOND
        found = None
        for second in range(last, last - lasting("looked_back") // SECOND, -1):
            spot = self._jumped.get((node, second))
            alone = all(other == node for other in self._missing.seconds.get(second, ()))
            if spot is not None and spot.ran <= until.ran and alone:
                found, last = spot, second
            elif last - second > pause:
                break
        return found

    def repeated(self, start: int, stop: int, nodes: Collection[Node] | None = None) -> int:
        """Return how many transfers of some nodes, or of all, had the ID of the one before, and said something else."""
        return self._sum(self._repeated, start, stop, nodes)

    def _between(self, kept: CountsBySecond, start: int, stop: int) -> Iterator[Mapping[Node, int]]:
        base = self._clock.start or 0
        return kept.between((start - base) // SECOND, (stop - base) // SECOND)

    def _sum(self, kept: CountsBySecond, start: int, stop: int, nodes: Collection[Node] | None) -> int:
        return sum(
            count for of in self._between(kept, start, stop) for node, count in of.items()
            if nodes is None or node in nodes
        )  # fmt: skip
