"""When nodes started anew."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dissectors.kit.order import by_key
from dissectors.kit.rows import usable
from dissectors.times import NO_TIME, SECOND

if TYPE_CHECKING:
    from dissectors.kit.decoded import DecodedTable
    from dissectors.kit.view import View

_MOST = 4096
_AROUND = SECOND  # uptimes are whole seconds
_EVERY_NODE = -1


class _Uptimes(NamedTuple):
    """Uptimes that nodes tell in a batch, in the order in which they are heard: the first of each and the last one.

    `row` is where the first one stands, `fell` where one is lower than the one of that node before.
    """

    nodes: list[tuple[int, int]]
    row: list[int]
    first: list[int]
    last: list[int]
    fell: list[list[int]]


def _uptimes(status: DecodedTable) -> _Uptimes:
    """Return the uptimes of a batch."""
    rows = np.flatnonzero(usable(status) & (status.t != NO_TIME))
    order, first = by_key(status.bus[rows].astype(np.int64) << 8 | status.src[rows])
    uptime = status["uptime_sec"][rows[order]].astype(np.int64)
    lower = np.zeros(len(rows), bool)
    np.less(uptime[1:], uptime[:-1], out=lower[1:])
    lower[first] = False
    fell: list[list[int]] = [[] for _ in first]
    at = np.flatnonzero(lower)
    for k, row in zip((np.searchsorted(first, at, "right") - 1).tolist(), rows[order[at]].tolist(), strict=True):
        fell[k].append(row)
    heard = np.argsort(order[first], kind="stable")
    begins, ends = first[heard], (np.append(first[1:], len(rows)) - 1)[heard]
    leads = rows[order[begins]]
    return _Uptimes(
        list(zip(status.bus[leads].tolist(), status.src[leads].tolist(), strict=True)), leads.tolist(),
        uptime[begins].tolist(), uptime[ends].tolist(), [fell[k] for k in heard.tolist()],
    )  # fmt: skip


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
        fallen: list[int] = []
        for node, row, first, last, fell in zip(*status.once(_uptimes), strict=True):
            if node in self._uptimes or len(self._uptimes) < _MOST:
                if first < self._uptimes.get(node, 0):
                    fallen.append(row)
                fallen += fell
                self._uptimes[node] = last
        for row in sorted(fallen):
            at, uptime = status.t.item(row), int(status["uptime_sec"][row])
            self.add(at - uptime * SECOND, status.bus.item(row), status.src.item(row), at)

    def add(self, t: int, bus: int, node: int = _EVERY_NODE, told: int | None = None) -> None:
        """Note that a node, or every one of a bus, began something new."""
        self._known.append((bus, node, t, t if told is None else told))

    def between(self, bus: int, node: int, start: int, stop: int, known: int) -> bool:
        """Return whether a node began anew between two times, or nearly, as far as was known at a third one."""
        return any(
            place == bus and who in (_EVERY_NODE, node) and start - _AROUND <= t <= stop + _AROUND and told <= known
            for place, who, t, told in self._known
        )
