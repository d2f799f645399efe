"""Nodes that go on sending, but without NodeStatus."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from analyzer.facts.node_status import NODE_STATUS
from analyzer.rules.bus.heard import HeardNodes
from dissectors.kit import NO_TIME, SECOND, Occurrence, Rule, all_resumed, groups, resumptions

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, Severity, View

OFFLINE = 3 * SECOND  # after which others take a node as offline
_NODES = 128
_THEN = ("node still sends", "then the node was silent")


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
        timed = np.flatnonzero(t.t != NO_TIME)
        self._active[code[timed]] = t.t[timed]
        self._woke = np.concatenate((self._woke, np.full(max(new, 0), NO_TIME)))
        self._wake(view, code)
        for node in np.flatnonzero((before == NO_TIME) & (self._active != NO_TIME)).tolist():
            if node % _NODES:
                row = int(timed[np.argmax(code[timed] == node)])
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
                of_node = of_node or {one: timed[mine] for one, mine in groups(code[timed])}
                own = of_node[node]
                sent = np.searchsorted(own, rows[late])
                active = np.where(sent > 0, t.t[own[np.maximum(sent - 1, 0)]], before[node])
                start, owes = self._owes(view, node, before_each[late], active)
                late = late[owes]
                for k, silence in self._silences(view, node, start[owes], active[owes], t.t[rows[late]]):
                    at = late.item(k)
                    last = known if known is not None and not at else _place(view, int(rows[at - 1]), NODE_STATUS)
                    yield replace(last, **silence)
            self._status[node] = _place(view, int(rows[-1]), NODE_STATUS)

    def finish(self, view: View) -> Iterator[Occurrence]:
        """Yield silences that lasted to the end, and nodes that never sent a NodeStatus."""
        for node, first in self._first.items():
            active = min(int(self._active[node]), view.before)  # the clock may have been set back since
            if node in self._status:
                last = self._status[node]
                start, late = self._owes(view, node, np.array([last.t]), np.array([active]))
                for _, silence in self._silences(view, node, start[late], np.array([active])[late], view.before):
                    yield replace(last, **silence)
            elif active - first.t > OFFLINE:
                silent = self._then_silent(view, node, (np.array([first.t]), np.array([active])), view.before)
                values = {"seconds": (active - first.t) / SECOND, "then": _THEN[silent.item(0)]}
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

    def _silences(
        self, view: View, node: int, start: Array, active: Array, end: Array | int
    ) -> Iterator[tuple[int, dict[str, Any]]]:
        """Yield which of some silences a node owes, and what is said of them.

        It was active from times to other ones, and its next NodeStatus are at `end`. Gaps blame nobody, and a node that
        was silent for most of the time owes nothing for that.
        """
        begin, stop = self._longest(node, start, active)
        mostly = 2 * (stop - begin) > active - start
        before = begin - start >= active - stop
        start, active = np.where(mostly & ~before, stop, start), np.where(mostly & before, begin, active)
        owed = np.flatnonzero(active - start > view.number("BUS-020", "late_s") * SECOND)
        start, active, end = start[owed], active[owed], np.broadcast_to(end, mostly.shape)[owed]
        then = self._then_silent(view, node, (start, active), end)
        for k, since, until, silent in zip(*(column.tolist() for column in (owed, start, active, then)), strict=True):
            severity: Severity | None = None if until - since > OFFLINE else "note"
            values = {"seconds": (until - since) / SECOND, "then": _THEN[silent]}
            told = {"values": values, "severity": severity, "drops": True, "until": min(until, since + OFFLINE)}
            yield k, told

    def _owes(self, view: View, node: int, since: Array, active: Array) -> tuple[Array, Array]:
        """Return since when a node could have reported again, and whether it was active too long after that.

        It is asked of times of the last NodeStatus, and of those until when the node was active.
        """
        woke = self._woke.item(node)
        start = np.maximum(since, np.where(woke <= active, woke, all_resumed(view, active)))
        return start, (active != NO_TIME) & (active - start > view.number("BUS-020", "late_s") * SECOND)

    def _longest(self, node: int, start: Array, stop: Array) -> tuple[Array, Array]:
        """Return the longest times between two others in which a node was silent."""
        return (stop, stop) if self._nodes is None else self._nodes.longest(*divmod(node, _NODES), start, stop)

    def _then_silent(self, view: View, node: int, active: tuple[Array, Array], end: Array | int) -> Array:
        """Return whether a node was silent after that, longer than while it was active."""
        begin, stop = self._longest(node, *active)
        silent: Array = end - active[1] > np.maximum(view.number("BUS-020", "late_s") * SECOND, stop - begin)
        return silent


def _place(view: View, row: int, name: str) -> Occurrence:
    t = view.transfers
    return Occurrence("BUS-020", int(t.t[row]), int(t.bus[row]), int(t.src[row]), name, tuple(t.frames(row)), {})
