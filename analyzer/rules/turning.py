"""ESCs that are heard and motors that turn, by the messages of which a profile says that they tell it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import NO_TIME, NODES, SECOND, RunningTime, sender, usable

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors import Registry
    from dissectors.kit import DecodedTable, View

_NODE_BITS = 7
_UNKNOWN = -1

_Step = tuple[int, int, int, bool]  # number of the transfer, its time, the sender, whether its motor turns from then on


class Turning:
    """Follows them over batches. `nodes` are senders by bus and node, each an ESC."""

    def __init__(self, registry: Registry) -> None:
        self._columns = {message.table: message.turns for message in registry.turning()}
        self.nodes: dict[int, bool] = {}  # sender: whether its motor turns
        self._last = np.full(NODES, _UNKNOWN, np.int8)  # the same of every sender
        self._count: dict[int, int] = {}  # of turning motors, by bus
        self._running = RunningTime()

    def feed(self, view: View) -> None:
        """Add the next batch."""
        steps: list[_Step] = []
        for name, column in self._columns.items():
            table = view.table(name)
            if table is not None and column in table:
                steps += self._steps(table, column)
        for _, t, node, on in sorted(steps):
            self._take(t, node >> _NODE_BITS, on)
        self._running.end = view.end

    def facts(self) -> dict[str, float]:
        """Return how many ESCs there are, and seconds with motors turning on the bus with the most; none without one.

        Buses may repeat each other, so a node counts once.
        """
        if not self.nodes:
            return {}
        escs = {node & (1 << _NODE_BITS) - 1 for node in self.nodes}
        return {"escs": len(escs), "running_s": self._running.longest / SECOND}

    def _steps(self, table: DecodedTable, column: str) -> Iterator[_Step]:
        """Yield the rows in which a motor begins or stops to turn."""
        rows = np.flatnonzero(usable(table) & (table.t != NO_TIME))
        nodes, on = sender(table, rows), table[column][rows] != 0
        for node in np.unique(nodes[self._last[nodes] != on]).tolist():
            mine = np.flatnonzero(nodes == node)
            before = self.nodes.get(node, False)
            changed = mine[on[mine] != np.concatenate(([before], on[mine][:-1]))]
            self.nodes[node] = bool(on[mine[-1]])
            self._last[node] = on[mine[-1]]
            for k in changed.tolist():
                yield int(table["transfer"][rows[k]]), int(table.t[rows[k]]), node, bool(on[k])

    def _take(self, t: int, bus: int, on: bool) -> None:
        before = self._count.get(bus, 0)
        self._count[bus] = before + (1 if on else -1)
        if not before or not self._count[bus]:
            self._running.note(bus, t, turning=on)
