"""When nodes started anew."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit.order import by_key
from dissectors.kit.rows import usable
from dissectors.times import NO_TIME, SECOND

if TYPE_CHECKING:
    from dissectors.kit.view import View

_MOST = 4096
_AROUND = SECOND  # uptimes are whole seconds
_EVERY_NODE = -1


class Starts:
    """Starts of nodes whose uptime fell, the last 4096 of all; more may be added."""

    def __init__(self) -> None:
        self._uptimes: dict[tuple[int, int], int] = {}
        self._known: deque[tuple[int, int, int, int]] = deque(maxlen=_MOST)  # bus, node, time, when it was told

    def feed(self, view: View) -> None:
        """Note those that the NodeStatus of a batch show."""
        status = view.table("uavcan.protocol.NodeStatus")
        if status is None:
            return
        rows = np.flatnonzero(usable(status) & (status.t != NO_TIME))
        t, uptime = status.t[rows], status["uptime_sec"][rows].astype(np.int64)
        bus, node = status.bus[rows].astype(np.int64), status.src[rows].astype(np.int64)
        order, first = by_key(bus << 8 | node)
        if not len(order):
            return
        ordered, of = uptime[order], list(zip(bus[order[first]].tolist(), node[order[first]].tolist(), strict=True))
        before = np.roll(ordered, 1)
        before[first] = [self._uptimes.get(who, 0) for who in of]
        ends, fell = np.append(first[1:], len(order)), ordered < before
        for k in np.argsort(order[first], kind="stable").tolist():
            if of[k] in self._uptimes or len(self._uptimes) < _MOST:
                self._uptimes[of[k]] = ordered.item(ends.item(k) - 1)
            else:
                fell[first[k] : ends[k]] = False
        for row in np.sort(order[fell]).tolist():
            at = t.item(row)
            self.add(at - uptime.item(row) * SECOND, bus.item(row), node.item(row), at)

    def add(self, t: int, bus: int, node: int = _EVERY_NODE, told: int | None = None) -> None:
        """Note that a node, or every one of a bus, began something new."""
        self._known.append((bus, node, t, t if told is None else told))

    def between(self, bus: int, node: int, start: int, stop: int, known: int) -> bool:
        """Return whether a node began anew between two times, or nearly, as far as was known at a third one."""
        return any(
            place == bus and who in (_EVERY_NODE, node) and start - _AROUND <= t <= stop + _AROUND and told <= known
            for place, who, t, told in self._known
        )
