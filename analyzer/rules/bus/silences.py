"""Nodes that go on sending, but without NodeStatus."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from analyzer.decode.grouped import grouped
from analyzer.facts.node_status import NODE_STATUS
from analyzer.rules.bus.heard import HeardNodes
from dissectors.kit import NO_TIME, SECOND, Occurrence, Rule, all_resumed, resumptions

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, Severity, View

OFFLINE = 3 * SECOND  # after which others take a node as offline
_NODES = 128
_ROW_BITS = 40  # below the node
_THEN = ("node still sends", "then the node was silent")


class StatusSilences(Rule):
    """Compares each NodeStatus with the one before it. Nodes are at most 127 an interface."""

    rules: ClassVar[tuple[str, ...]] = ("BUS-020",)

    def __init__(self) -> None:
        self._nodes: HeardNodes | None = None
        self._first: dict[int, Occurrence] = {}
        # Of nodes whose last NodeStatus had more than one frame, these,
        self._several: dict[int, tuple[int, ...]] = {}
        # of each node, `NO_TIME` without: when its last NodeStatus came, and the number of its first frame,
        self._since: Array = np.full(0, NO_TIME)
        self._lead: Array = np.full(0, NO_TIME)
        self._active: Array = np.full(0, NO_TIME)  # when it last spoke,
        self._woke: Array = np.full(0, NO_TIME)  # and when it first did since the last gap of the capture

    def feed(self, view: View) -> Iterator[Occurrence]:
        """Yield silences that ended."""
        self._nodes = self._nodes or HeardNodes(round(view.number("BUS-020", "late_s") * SECOND))
        self._nodes.feed(view.frames)
        t = view.transfers
        code = t.bus.astype(np.int64) * _NODES + t.src
        new = np.full(max(len(view.buses) * _NODES - len(self._active), 0), NO_TIME)
        if len(new):
            self._since, self._lead, self._active, self._woke = (
                np.append(known, new) for known in (self._since, self._lead, self._active, self._woke)
            )
        before = self._active
        self._active = before.copy()
        timed = np.flatnonzero(t.t != NO_TIME)
        self._active[code[timed]] = t.t[timed]
        self._wake(view, code)
        for node in np.flatnonzero((before == NO_TIME) & (self._active != NO_TIME)).tolist():
            if node % _NODES:
                row = int(timed[np.argmax(code[timed] == node)])
                self._first[node] = _place(view, row, view.type_name(int(t.code[row])))
        table = view.table(NODE_STATUS)
        if table is not None:
            reports = table.row[table.trusted & (table.t != NO_TIME)]
            reports = reports[np.lexsort((t.lead[reports], code[reports]))]
            reports = reports[t.lead[reports] > self._lead[code[reports]]]  # some come out late
            yield from self._report(view, reports, code, timed, before)

    def _report(self, view: View, rows: Array, code: Array, timed: Array, before: Array) -> Iterator[Occurrence]:
        """Yield silences that ended with some NodeStatus, those of a node in their order."""
        if not len(rows):
            return
        t, node = view.transfers, code[rows]
        first = np.append(True, node[1:] != node[:-1])
        since = np.append(NO_TIME, t.t[rows[:-1]])
        since[first] = self._since[node[first]]
        late = np.flatnonzero((since != NO_TIME) & (t.t[rows] - since > view.number("BUS-020", "late_s") * SECOND))
        if len(late):
            active = _last_before(rows[late], code, timed, t.t, before)
            start, owes = self._owes(view, node[late], since[late], active)
            late, start, active = late[owes], start[owes], active[owes]
            for k, silence in self._silences(view, node[late], start, active, t.t[rows[late]]):
                at = late.item(k)
                last = self._last(node.item(at)) if first[at] else _place(view, rows.item(at - 1), NODE_STATUS)
                yield replace(last, **silence)
        last_of = np.append(first[1:], True)
        rows, node = rows[last_of], node[last_of]
        self._since[node], self._lead[node] = t.t[rows], t.lead[rows]
        offsets, _ = t.frame_lists
        single = offsets[rows + 1] - offsets[rows] == 1
        for one in self._several.keys() & set(node[single].tolist()) if self._several else ():
            del self._several[one]
        for one, row in zip(node[~single].tolist(), rows[~single].tolist(), strict=True):
            self._several[one] = tuple(t.frames(row))

    def finish(self, view: View) -> Iterator[Occurrence]:
        """Yield silences that lasted to the end, and nodes that never sent a NodeStatus."""
        for node, first in self._first.items():
            active = min(int(self._active[node]), view.before)  # the clock may have been set back since
            nodes, until = np.array([node]), np.array([active])
            if self._lead[node] != NO_TIME:
                start, late = self._owes(view, nodes, self._since[nodes], until)
                for _, silence in self._silences(view, nodes[late], start[late], until[late], view.before):
                    yield replace(self._last(node), **silence)
            elif active - first.t > OFFLINE:
                silent = self._then_silent(view, nodes, (np.array([first.t]), until), view.before)
                values = {"seconds": (active - first.t) / SECOND, "then": _THEN[silent.item(0)]}
                yield replace(first, values=values, severity="note")

    def _wake(self, view: View, code: Array) -> None:
        """Note the first transfer of each node behind the last gap that it spoke after."""
        t = view.transfers.t
        known = (t != NO_TIME).nonzero()[0]
        if not len(known):
            return
        t, code = t[known], code[known]
        begins = resumptions(view, int(t.min()), int(t.max()))
        if not (self._woke[code] < begins[-1]).any():
            return
        latest = np.full(len(self._woke), NO_TIME)
        np.maximum.at(latest, code, t)
        last = begins.searchsorted(latest, "right") - 1
        since = np.where(last >= 0, begins[last], NO_TIME)
        rows = ((t >= since[code]) & (self._woke[code] < since[code])).nonzero()[0][::-1]
        self._woke[code[rows]] = t[rows]

    def _silences(
        self, view: View, node: Array, start: Array, active: Array, end: Array | int
    ) -> Iterator[tuple[int, dict[str, Any]]]:
        """Yield which of some silences their nodes owe, and what is said of them.

        These were active from times to other ones, and their next NodeStatus are at `end`. Gaps blame nobody, and a
        node that was silent for most of the time owes nothing for that.
        """
        begin, stop = self._longest(node, start, active)
        mostly = 2 * (stop - begin) > active - start
        before = begin - start >= active - stop
        start, active = np.where(mostly & ~before, stop, start), np.where(mostly & before, begin, active)
        owed = np.flatnonzero(active - start > view.number("BUS-020", "late_s") * SECOND)
        start, active, end = start[owed], active[owed], np.broadcast_to(end, mostly.shape)[owed]
        then = self._then_silent(view, node[owed], (start, active), end)
        for k, since, until, silent in zip(*(column.tolist() for column in (owed, start, active, then)), strict=True):
            severity: Severity | None = None if until - since > OFFLINE else "note"
            values = {"seconds": (until - since) / SECOND, "then": _THEN[silent]}
            told = {"values": values, "severity": severity, "drops": True, "until": min(until, since + OFFLINE)}
            yield k, told

    def _owes(self, view: View, node: Array, since: Array, active: Array) -> tuple[Array, Array]:
        """Return since when nodes could have reported again, and whether they were active too long after that.

        It is asked of times of the last NodeStatus, and of those until when the node was active.
        """
        late, start, woke = view.number("BUS-020", "late_s") * SECOND, since.copy(), self._woke[node]
        some = np.flatnonzero((active != NO_TIME) & (active - since > late))
        woke, until = woke[some], active[some]
        start[some] = np.maximum(since[some], np.where(woke <= until, woke, all_resumed(view, until)))
        return start, (active != NO_TIME) & (active - start > late)

    def _last(self, node: int) -> Occurrence:
        """Return the last NodeStatus of a node."""
        bus, src = divmod(node, _NODES)
        frames = self._several.get(node, (self._lead.item(node),))
        return Occurrence("BUS-020", self._since.item(node), bus, src, NODE_STATUS, frames, {})

    def _longest(self, node: Array, start: Array, stop: Array) -> tuple[Array, Array]:
        """Return the longest times between two others in which nodes were silent."""
        return (stop, stop) if self._nodes is None else self._nodes.longest(node, start, stop)

    def _then_silent(self, view: View, node: Array, active: tuple[Array, Array], end: Array | int) -> Array:
        """Return whether nodes were silent after that, longer than while they were active."""
        begin, stop = self._longest(node, *active)
        silent: Array = end - active[1] > np.maximum(view.number("BUS-020", "late_s") * SECOND, stop - begin)
        return silent


def _last_before(rows: Array, code: Array, timed: Array, t: Array, before: Array) -> Array:
    """Return when the node of each row spoke last in front of it; `before` is when nodes did in front of the batch."""
    own = timed[grouped(code[timed])[0]]
    at = np.searchsorted(code[own] << _ROW_BITS | own, code[rows] << _ROW_BITS | rows) - 1
    last = own[np.maximum(at, 0)]
    found: Array = np.where((at >= 0) & (code[last] == code[rows]), t[last], before[code[rows]])
    return found


def _place(view: View, row: int, name: str) -> Occurrence:
    t = view.transfers
    return Occurrence("BUS-020", int(t.t[row]), int(t.bus[row]), int(t.src[row]), name, tuple(t.frames(row)), {})
