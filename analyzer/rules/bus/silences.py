"""Nodes that go on sending, but without NodeStatus."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from analyzer.facts.node_status import NODE_STATUS
from analyzer.rules.bus.heard import Gap, HeardNodes
from dissectors.kit import NO_TIME, SECOND, Occurrence, Rule, all_resumed, groups, resumptions

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, Severity, View

OFFLINE = 3 * SECOND  # after which others take a node as offline
_NODES = 128


class StatusSilences(Rule):
    """Compares each NodeStatus with the one before it. Nodes are at most 127 an interface."""

    rules: ClassVar[tuple[str, ...]] = ("BUS-020",)

    def __init__(self) -> None:
        self._nodes: HeardNodes | None = None
        self._first: dict[int, Occurrence] = {}
        self._status: dict[int, Occurrence] = {}
        self._active: Array = np.full(0, NO_TIME)
        self._woke: Array = np.full(0, NO_TIME)  # when each node first spoke since the last gap of the capture

    def feed(self, view: View) -> Iterator[Occurrence]:
        """Yield silences that ended."""
        self._nodes = self._nodes or HeardNodes(round(view.number("BUS-020", "late_s") * SECOND))
        self._nodes.feed(view.frames)
        t = view.transfers
        code = t.bus.astype(np.int64) * _NODES + t.src
        new = len(view.buses) * _NODES - len(self._active)
        before = self._active = np.concatenate((self._active, np.full(max(new, 0), NO_TIME)))
        self._active = before.copy()
        self._active[code] = t.t
        self._woke = np.concatenate((self._woke, np.full(max(new, 0), NO_TIME)))
        self._wake(view, code)
        for node in np.flatnonzero((before == NO_TIME) & (self._active != NO_TIME)).tolist():
            if node % _NODES:
                row = int(np.argmax(code == node))
                self._first[node] = _place(view, row, view.type_name(int(t.code[row])))
        table = view.table(NODE_STATUS)
        reports = np.empty(0, np.int64) if table is None else table.row[table.trusted & (table.t != NO_TIME)]
        reports = reports[np.argsort(t.lead[reports], kind="stable")]
        of_node: dict[int, Array] = {}
        for node, places in groups(code[reports]):
            rows = reports[places]
            known = self._status.get(node)
            rows = rows if known is None else rows[t.lead[rows] > known.frames[0]]  # some come out late
            if not len(rows):
                continue
            before_each = np.append(int(t.t[rows[0]]) if known is None else known.t, t.t[rows[:-1]])
            late = np.flatnonzero(t.t[rows] - before_each > view.number("BUS-020", "late_s") * SECOND)
            if len(late):
                of_node = of_node or dict(groups(code))
                own = of_node[node]
                sent = np.searchsorted(own, rows[late])
                active = np.where(sent > 0, t.t[own[np.maximum(sent - 1, 0)]], before[node])
                start, owes = self._owes(view, node, before_each[late], active)
                columns = (late, start, active, t.t[rows[late]])
                for at, *times in zip(*(column[owes].tolist() for column in columns), strict=True):
                    last = known if known is not None and not at else _place(view, int(rows[at - 1]), NODE_STATUS)
                    yield from self._silence(view, last, node, *times)
            self._status[node] = _place(view, int(rows[-1]), NODE_STATUS)

    def finish(self, view: View) -> Iterator[Occurrence]:
        """Yield silences that lasted to the end, and nodes that never sent a NodeStatus."""
        for node, first in self._first.items():
            active = min(int(self._active[node]), view.before)  # the clock may have been set back since
            if node in self._status:
                last = self._status[node]
                start, late = self._owes(view, node, np.array([last.t]), np.array([active]))
                if late[0]:
                    yield from self._silence(view, last, node, start.item(0), active, view.before)
            elif active - first.t > OFFLINE:
                owes = (first.t, active)
                values = {"seconds": (active - first.t) / SECOND, "then": self._then(view, node, owes, view.before)}
                yield replace(first, values=values, severity="note")

    def _wake(self, view: View, code: Array) -> None:
        """Note the first transfer of each node behind each gap."""
        t = view.transfers.t
        known = np.flatnonzero(t != NO_TIME)
        if not len(known):
            return
        for begin in resumptions(view, int(t[known].min()), int(t[known].max())).tolist():
            rows = known[t[known] >= begin]
            rows = rows[self._woke[code[rows]] < begin][::-1]
            self._woke[code[rows]] = t[rows]

    def _silence(
        self, view: View, last: Occurrence, node: int, start: int, active: int, end: int
    ) -> Iterator[Occurrence]:
        """Yield what a node owes that was active from a time to another one, and whose next NodeStatus is at `end`.

        Gaps blame nobody, and a node that was silent for most of the time owes nothing for that.
        """
        least = view.number("BUS-020", "late_s") * SECOND
        most = self._gap(node, start, active)
        if 2 * (most.stop - most.start) > active - start:
            start, active = max((start, most.start), (most.stop, active), key=lambda part: part[1] - part[0])
        silence = active - start
        if silence > least:
            values = {"seconds": silence / SECOND, "then": self._then(view, node, (start, active), end)}
            severity: Severity | None = None if silence > OFFLINE else "note"
            yield replace(last, values=values, severity=severity, drops=True, until=min(active, start + OFFLINE))

    def _owes(self, view: View, node: int, since: Array, active: Array) -> tuple[Array, Array]:
        """Return since when a node could have reported again, and whether it was active too long after that.

        It is asked of times of the last NodeStatus, and of those until when the node was active.
        """
        woke = self._woke.item(node)
        start = np.maximum(since, np.where(woke <= active, woke, all_resumed(view, active)))
        return start, (active != NO_TIME) & (active - start > view.number("BUS-020", "late_s") * SECOND)

    def _gap(self, node: int, start: int, stop: int) -> Gap:
        """Return the longest time between two others in which a node was silent."""
        gaps = [] if self._nodes is None else self._nodes.gaps(*divmod(node, _NODES), start, stop)
        return max(gaps, key=lambda gap: gap.stop - gap.start, default=Gap(stop, stop, -1))

    def _then(self, view: View, node: int, active: tuple[int, int], end: int) -> str:
        """Say whether a node was silent after that, longer than while it was active."""
        most = self._gap(node, *active)
        silent = end - active[1] > max(view.number("BUS-020", "late_s") * SECOND, most.stop - most.start)
        return "then the node was silent" if silent else "node still sends"


def _place(view: View, row: int, name: str) -> Occurrence:
    t = view.transfers
    return Occurrence("BUS-020", int(t.t[row]), int(t.bus[row]), int(t.src[row]), name, tuple(t.frames(row)), {})
