"""Losses of senders: broken transfers and missing IDs of each node, by second."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from analyzer.decode.grouped import grouped
from analyzer.flight.thresholds import lasting
from analyzer.tables import STATUSES, TRANSFER_ANOMALIES, TRANSFER_IDS
from dissectors.kit.cells import numbers
from dissectors.times import NO_TIME, SECOND

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from analyzer.decode.engine import Batch
    from analyzer.flight.clock import RecordedClock, Spot
    from dissectors.kit import Array

MOST_ENTRIES = 1 << 18
_GAP = 1 << TRANSFER_ANOMALIES.index("transfer id gap")
_REPEATED = 1 << TRANSFER_ANOMALIES.index("transfer id repeated")
_BROKEN = [STATUSES.index(name) for name in ("bad crc", "interrupted", "timed out", "too short")]

Node = tuple[int, int]  # bus, node


class LossesBySecond:
    """Adds up batches; the `clock` is fed before. Of more than `MOST_ENTRIES` nothing is told apart any more."""

    def __init__(self, clock: RecordedClock) -> None:
        self._clock = clock
        self._broken: Counter[tuple[Node, int]] = Counter()
        self._missing: Counter[tuple[Node, int]] = Counter()
        self._repeated: Counter[tuple[Node, int]] = Counter()
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
        broken = np.flatnonzero(np.isin(status, _BROKEN) & timed)
        if not len(gaps) and not len(again) and not len(broken):
            return
        node = numbers(transfers.column("bus")).astype(np.int64) << 8 | numbers(transfers.column("src"))
        left_out = (numbers(transfers.column("step"))[gaps].astype(np.int64) - 1) % TRANSFER_IDS
        for rows, kept, much in (
            (gaps, self._missing, left_out), (again, self._repeated, np.ones_like(again)),
            (broken, self._broken, np.ones_like(broken)),
        ):  # fmt: skip
            new: dict[tuple[Node, int], int] = {}
            for key, row, count in self._summed(node[rows], rows, much):
                if key not in kept:
                    if len(kept) >= MOST_ENTRIES:
                        continue
                    new[key] = row
                kept[key] += count
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

    def broken(self, start: int, stop: int, nodes: Iterable[Node] | None = None) -> int:
        """Return how many transfers of some nodes, or of all, were not whole in a time."""
        return self._sum(self._broken, start, stop, nodes)

    def most_broken(self, start: int, stop: int) -> tuple[Node, int] | None:
        """Return whose transfers were not whole most often in a time, and how many these are; None if all were."""
        found: Counter[Node] = Counter()
        base = self._clock.start or 0
        for (node, second), count in self._broken.items():
            if (start - base) // SECOND <= second <= (stop - base) // SECOND:
                found[node] += count
        return max(found.items(), key=lambda one: (one[1], one[0])) if found else None

    def missing(self, start: int, stop: int, nodes: Iterable[Node] | None = None) -> int:
        """Return how many transfer IDs of some nodes, or of all, were left out in a time."""
        return self._sum(self._missing, start, stop, nodes)

    def since(self, node: Node, until: Spot) -> Spot | None:
        """Return since when IDs of a node alone are left out again and again, up to a time; None if they are not."""
        last, pause = (until.ran - (self._clock.start or 0)) // SECOND, lasting("harmless") // SECOND
        others = {second for other, second in self._missing if other != node}
        found = None
        for second in range(last, last - lasting("looked_back") // SECOND, -1):
            spot = self._jumped.get((node, second))
            if spot is not None and spot.ran <= until.ran and second not in others:
                found, last = spot, second
            elif last - second > pause:
                break
        return found

    def repeated(self, start: int, stop: int, nodes: Iterable[Node] | None = None) -> int:
        """Return how many transfers of some nodes, or of all, had the ID of the one before, and said something else."""
        return self._sum(self._repeated, start, stop, nodes)

    def _sum(self, kept: Counter[tuple[Node, int]], start: int, stop: int, nodes: Iterable[Node] | None) -> int:
        base, wanted = self._clock.start or 0, None if nodes is None else set(nodes)
        first, last = (start - base) // SECOND, (stop - base) // SECOND
        return sum(
            count for (node, second), count in kept.items()
            if first <= second <= last and (wanted is None or node in wanted)
        )  # fmt: skip
