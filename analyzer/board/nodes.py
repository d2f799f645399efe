"""Every node that sends: how much, what it says of its health, and when it began anew."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.board.groups import NONE, Groups, LongestGaps, Slots
from analyzer.board.meter import Meter
from analyzer.board.snapshot import Latched, NodeRow, Tally
from analyzer.facts.node_names import NodeNames
from analyzer.facts.node_status import HEALTHS, MODES
from analyzer.tables import KINDS
from dissectors.kit import MILLISECOND, SECOND
from dissectors.kit.cells import numbers, valid

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    import pyarrow as pa

    from analyzer.board.latches import Latches
    from dissectors.kit import Array

MOST_NODES = 1024
_MESSAGE = KINDS.index("message")
STALE = 3 * SECOND  # without a transfer; a node sends its status once a second at least
_LONG = 2500 * MILLISECOND  # between two of them


class NodeStates:
    """Adds up transfers and NodeStatus by bus and node; the first `MOST_NODES` that send.

    Args:
        latches: told of restarts.
    """

    def __init__(self, latches: Latches) -> None:
        self._latches = latches
        self._slots = Slots(MOST_NODES)
        self._meter = Meter(MOST_NODES + 1, 2)
        self._hidden: set[int] = set()
        self.names = NodeNames()
        self._heard, self._said, self._uptime, self._health, self._mode = (
            np.full(MOST_NODES + 1, NONE, np.int64) for _ in range(5)
        )
        self._gaps = LongestGaps(MOST_NODES + 1)
        self._restarts: dict[int, int] = {}

    @property
    def beyond(self) -> int:
        """Nodes that found no place."""
        return self._slots.beyond

    def feed(self, transfers: pa.RecordBatch) -> None:
        """Take the transfers of a batch, whole or broken; anonymous ones belong to no node."""
        src, end = numbers(transfers.column("src")), transfers.column("t_end")
        rows = np.flatnonzero(((src > 0) | (numbers(transfers.column("kind")) == _MESSAGE)) & valid(end))
        if not len(rows):
            return
        groups = Groups(numbers(transfers.column("bus"))[rows].astype(np.int64) << 8 | src[rows])
        places = self._slots.find(groups)
        t = numbers(end)[rows]
        self._heard[places] = groups.last(t)
        if self._hidden:
            self._hidden.difference_update(groups.keys)
        frames = np.diff(np.asarray(transfers.column("frame").offsets))[rows]
        self._meter.feed(t, groups.spread(places), (frames, None))

    def feed_status(self, table: pa.RecordBatch, buses: tuple[str, ...]) -> None:
        """Take the NodeStatus of a batch."""
        src = numbers(table.column("src"))
        rows = np.flatnonzero(numbers(table.column("trusted")) & valid(table.column("t")))
        if not len(rows):
            return
        groups = Groups(numbers(table.column("bus"))[rows].astype(np.int64) << 8 | src[rows])
        places = self._slots.find(groups)
        t, uptime = numbers(table.column("t"))[rows], numbers(table.column("uptime_sec"))[rows].astype(np.int64)
        self._gaps.feed(groups, places, t, self._said[places])
        was = groups.previous(uptime, self._uptime[places])
        back = np.flatnonzero(uptime < was)
        if len(back):
            self._restart(groups, back, (t, was), buses)
        self._said[places] = groups.last(t)
        self._uptime[places] = groups.last(uptime)
        self._health[places] = groups.last(numbers(table.column("health"))[rows])
        self._mode[places] = groups.last(numbers(table.column("mode"))[rows])

    def _restart(self, groups: Groups, back: Array, values: tuple[Array, Array], buses: tuple[str, ...]) -> None:
        """Latch each node whose uptime went back, in these rows."""
        t, was = values
        keys = groups.spread(np.array(groups.keys))[back]
        for key in np.unique(keys).tolist():
            rows = back[keys == key]
            self._restarts[key] = self._restarts.get(key, 0) + len(rows)
            text = f"began anew after {was[rows[-1]]} s"
            subject = f"{buses[key >> 8]} node {key & 0xFF}"
            self._latches.put("restart", key, subject, text, int(t[rows[-1]]), count=len(rows), first=int(t[rows[0]]))

    def mark(self) -> None:
        """Let longest gaps and restarts count anew."""
        self._gaps.clear()
        self._restarts.clear()

    def clear(self, now: int) -> None:
        """Hide nodes that are stale until they send again."""
        self._hidden |= {key for key, place in self._slots.of.items() if now - self._heard[place] > STALE}

    def rows(
        self, now: int, buses: tuple[str, ...], ages: Mapping[tuple[str, int], int],
        found: Mapping[tuple[int, int], Tally], overdue: Mapping[int, int],
    ) -> Iterator[NodeRow]:  # fmt: skip
        """Give nodes by interface and number; `found` is by bus and node, `overdue` by bus << 8 | node.

        `ages` are how long nodes have been silent by the clock, where that is known to be longer than it seems.
        """
        rates = self._meter.rates(now)
        for key, place in sorted(self._slots.of.items()):
            if key in self._hidden:
                continue
            age = max(0, now - int(self._heard[place]), ages.get((buses[key >> 8], key & 0xFF), 0))
            health, mode, uptime = (int(one[place]) for one in (self._health, self._mode, self._uptime))
            yield NodeRow(
                bus=buses[key >> 8],
                node=key & 0xFF,
                name=self.names.all.get((key >> 8, key & 0xFF), ""),
                health="" if health == NONE else HEALTHS[health],
                mode="" if mode == NONE else MODES.get(mode, str(mode)),
                uptime=None if uptime == NONE else uptime,
                frames=float(rates[0, place]),
                transfers=float(rates[1, place]),
                age=age,
                gap=self._gaps.at(place)[0] or None,
                found=found.get((key >> 8, key & 0xFF), Tally()),
                restarts=self._restarts.get(key, 0),
                overdue=overdue.get(key, 0),
                stale=age > STALE,
            )

    def silences(self, now: int, buses: tuple[str, ...]) -> Iterator[Latched]:
        """Give nodes that said nothing of themselves for long since the mark, or say nothing now."""
        for key, place in self._slots.of.items():
            if key in self._hidden:
                continue
            subject, heard = f"{buses[key >> 8]} node {key & 0xFF}", int(self._heard[place])
            gap, ended = self._gaps.at(place)
            if now - heard > STALE:
                yield Latched("silence", subject, "silent", heard, now, 1, now=True)
            elif gap > _LONG:
                yield Latched("silence", subject, f"no status for {gap / SECOND:.1f} s", ended - gap, ended, 1)
