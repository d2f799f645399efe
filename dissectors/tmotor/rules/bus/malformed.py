"""Reports of ESCs that say nothing: what is sent of them, and what was lost."""

from __future__ import annotations

from array import array
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dissectors.kit import NO_TIME, NODES, by_key, changes, usable
from dissectors.tmotor.rules.joined.joins import MOST_UNITS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dissectors.kit import Array, View
    from dissectors.tmotor.rules.joined.joins import ReportingEsc

_MESSAGE, _FOREIGN = 0, 1  # as tables count kinds and verdicts
_TYPE = 0x1FFFF  # of an identifier's bits from 7 on: data type ID, and that it is a message
_MOST = 1024  # stretches of a node
_MOST_WAITING = 2048  # rows that are not yet made stretches: mostly nobody asks for these
_NODE_BITS, _ROW_BITS = 7, 40


class _Stretches(NamedTuple):
    """When stretches of a node begin and end, in ns."""

    since: array[int]
    until: array[int]

    def add(self, since: list[int], until: list[int]) -> None:
        """Add some; the oldest become one where they are too many."""
        self.since.extend(since)
        self.until.extend(until)
        oldest = len(self.since) - _MOST + 1
        if oldest > 1:
            self.since[:oldest] = array("q", [min(self.since[:oldest])])
            self.until[:oldest] = array("q", [max(self.until[:oldest])])

    def note(self, firsts: list[int], lasts: list[int], least: int) -> None:
        """Add when reports began and ended, in their order; what follows within `least` ns is the same stretch."""
        since, until = (self.since.pop(), self.until.pop()) if self.since else (firsts[0], lasts[0])
        begins, ends = [], []
        for first, last in zip(firsts, lasts, strict=True):
            if since <= first <= until + least:
                until = max(until, last)
                continue
            begins.append(since)
            ends.append(until)
            since, until = first, last
        self.add([*begins, since], [*ends, until])


class _Waiting(NamedTuple):
    """Reports in their order: bus and node in one number, when they began, and when they ended."""

    node: Array
    first: Array
    last: Array


class MalformedReports:
    """ESCStatus of each node that cannot be read, in stretches, and transfer IDs that were left out.

    A report that cannot be read names no index, so it is one of each index of its node. What follows within `least` ns
    belongs to the same stretch.
    """

    def __init__(self, least: int) -> None:
        self._least = least
        self._stretches: dict[int, _Stretches] = {}
        self._waiting: list[_Waiting] = []  # what is not yet part of them
        self._rows = 0  # in these
        self._lost = np.zeros(NODES, np.int64)  # before this batch, by bus and node in one number
        # That number and the rows of this batch before which some were lost, in order, and how many up to each.
        self._steps, self._counts = np.empty(0, np.int64), np.zeros(1, np.int64)

    def feed(self, view: View) -> None:
        """Add a batch."""
        self._add_steps()
        definition = view.definition("ESCStatus")
        if definition is None:
            return
        t, table = view.transfers, view.table("ESCStatus")
        mine = (t.type_id == definition.type_id) & (t.kind == _MESSAGE)
        rows = np.flatnonzero(mine & t.has("step") & (t.step > 1))
        if len(rows):
            node = t.bus[rows].astype(np.int64) << _NODE_BITS | t.src[rows]
            order, _ = by_key(node)
            self._steps = node[order] << _ROW_BITS | rows[order]
            self._counts = np.append(0, np.cumsum(t.step[rows[order]].astype(np.int64) - 1))
        if table is not None:
            mine[table.row[usable(table)]] = False
        rows = np.flatnonzero(mine & (t.t != NO_TIME))
        self._note(t.bus[rows], t.src[rows], t.t[rows], t.t_end[rows])
        self._astray(view, definition.type_id)
        if self._rows >= _MOST_WAITING:
            self._stretch()

    def _add_steps(self) -> None:
        """Make those of the last batch the ones before this one."""
        if not len(self._steps):
            return
        nodes = self._steps >> _ROW_BITS
        first = changes(nodes, -1)
        self._lost[nodes[first]] += self._counts[np.append(first[1:], len(nodes))] - self._counts[first]
        self._steps, self._counts = self._steps[:0], self._counts[:1]

    def lost(self, bus: Sequence[int], node: Sequence[int], size: Array, rows: Array) -> Array:
        """Return how many reports of its node were lost before each transfer of this batch.

        The transfers of each of some senders follow each other, so many of each.
        """
        codes = np.array(bus, np.int64) << _NODE_BITS | np.array(node, np.int64)
        before = np.repeat(self._lost[codes], size)
        if not len(self._steps):
            return before
        begin = codes << _ROW_BITS
        since = np.repeat(self._counts[np.searchsorted(self._steps, begin)], size)
        lost: Array = (
            before + self._counts[np.searchsorted(self._steps, np.repeat(begin, size) | rows, "right")] - since
        )
        return lost

    def between(self, unit: ReportingEsc, start: int, stop: int) -> list[tuple[int, int]]:
        """Return the times from one to another without such reports."""
        self._stretch()
        begin, found = start, []
        known = self._stretches.get(unit.bus << _NODE_BITS | unit.node)
        for first, last in () if known is None else sorted(zip(known.since, known.until, strict=True)):
            if last > begin and first < stop:
                found.append((begin, max(first, begin)))
                begin = last
        return [*found, (min(begin, stop), stop)]

    def _astray(self, view: View, type_id: int) -> None:
        """Note frames that belong to no transfer."""
        frames, late = view.frames, view.settled
        if frames.verdict.any():
            wanted = (frames.verdict > _FOREIGN) & (frames.id >> 7 & _TYPE == type_id << 1) & (frames.t != NO_TIME)
            rows = np.flatnonzero(wanted)
            t = frames.t[rows]
            self._note(frames.bus[rows], frames.id[rows] & 0x7F, t, t)
        wanted = late.known & (late.verdict > _FOREIGN) & (late.id >> 7 & _TYPE == type_id << 1)
        late = late.of(wanted & (late.t != NO_TIME))
        self._note(late.bus, late.id & 0x7F, late.t, late.t)

    def _note(self, bus: Array, node: Array, first: Array, last: Array) -> None:
        """Keep when reports began and ended, in their order."""
        if len(bus):
            self._waiting.append(_Waiting(bus.astype(np.int64) << _NODE_BITS | node, first, last))
            self._rows += len(bus)

    def _stretch(self) -> None:
        """Make stretches of what waits."""
        if not self._waiting:
            return
        every = _Waiting(*map(np.concatenate, zip(*self._waiting, strict=True)))
        self._waiting, self._rows = [], 0
        order, begins = by_key(every.node)
        firsts, lasts, leads = every.first[order].tolist(), every.last[order].tolist(), order[begins]
        ends = [*begins[1:].tolist(), len(firsts)]
        columns = (column.tolist() for column in (leads, begins, every.node[leads]))
        for (_, begin, node), end in sorted(zip(zip(*columns, strict=True), ends, strict=True)):
            known = self._stretches.get(node)
            if known is None:
                if len(self._stretches) >= MOST_UNITS:
                    continue
                known = self._stretches[node] = _Stretches(array("q"), array("q"))
            known.note(firsts[begin:end], lasts[begin:end], self._least)
