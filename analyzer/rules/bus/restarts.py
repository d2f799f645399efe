"""Restarts of nodes by their uptimes, and two devices that each tell one."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from analyzer.facts.node_status import NODE_STATUS
from dissectors.kit import NO_TIME, SECOND, Occurrence, Rule, breach, by_key
from dissectors.records import dataclass, replace

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from dissectors.kit import Array, DecodedTable, View

    _Place = Callable[[], Occurrence]  # where a report stands: few of those in doubt are told

RESTARTS = ("uavcan.protocol.RestartNode.Request", "uavcan.protocol.file.BeginFirmwareUpdate.Request")
ASKED = 10 * SECOND  # how long a restart may take that somebody asked for
MOST_ASKED = 15  # earlier requests for each node that are remembered
MOST_RESTARTS = 4096  # that wait for a request that comes out late
WRAP = 1 << 32  # of uptime_sec
NEAR_WRAP = 10  # seconds
PATIENCE = 3  # reports after a lower uptime that decide
SPREAD = 1.2  # seconds between an uptime and what the one before it lets expect: whole seconds, and jitter
BLIND = 5  # the same without times
EXPIRY = 10 * SECOND  # after it a device that is not heard is gone
ROUGHLY = 1.5  # seconds: an uptime is whole ones, and comes a little late
_NODE_BITS = 8  # below the bus
_Node = tuple[int, int]


@dataclass(slots=True)
class _Uptime:
    t: int
    seconds: int

    def runs_on(self, t: int, seconds: int) -> bool:
        """Return whether the same device says this later."""
        if NO_TIME in (t, self.t):
            return 0 <= seconds - self.seconds <= BLIND
        return abs(seconds - self.seconds - (t - self.t) / SECOND) <= SPREAD

    def may_end(self, t: int, seconds: int) -> bool:
        """Return whether the device can have started since: up no longer than that, else it is an old report again."""
        return NO_TIME in (t, self.t) or seconds <= (t - self.t) / SECOND + ROUGHLY


@dataclass(slots=True)
class _Doubt:
    """A lower uptime: `found` says that it is a restart, if it `can` be one and not both `old` and `new` run on."""

    found: Occurrence
    old: _Uptime
    new: _Uptime
    can: bool = True
    old_again: int = 0
    new_again: int = 0
    seen: int = 0


class Uptimes(Rule):
    """Restarts, and two devices by their uptimes. Nodes are at most 127 an interface."""

    rules: ClassVar[tuple[str, ...]] = ("BUS-021", "BUS-010")

    def __init__(self) -> None:
        # The last uptime of each node, by bus and node in one number, and when it was told; -1 without one.
        self._seconds: Array = np.empty(0, np.int64)
        self._told: Array = np.empty(0, np.int64)
        self._doubts: dict[_Node, _Doubt] = {}
        self._two: dict[_Node, list[_Uptime]] = {}
        self._asked: dict[_Node, list[int]] = {}
        self._restarts: list[Occurrence] = []

    def feed(self, view: View) -> Iterator[Occurrence]:
        """Look at every NodeStatus."""
        for name in RESTARTS:
            asking = view.table(name)
            if asking is not None:
                for bus, node, at in zip(asking.bus.tolist(), asking["dst"].tolist(), asking.t.tolist(), strict=True):
                    self._asked[bus, node] = [*self._asked.get((bus, node), ())[-MOST_ASKED:], at]
        yield from self._reports(view)
        yield from self._ripe(view.end)

    def _reports(self, view: View) -> Iterator[Occurrence]:
        table = view.table(NODE_STATUS)
        if table is None:
            return
        rows = self._doubted(table, np.flatnonzero(table.trusted))
        if not len(rows):
            return
        columns = (column[rows].tolist() for column in (table.bus, table.src, table.t, table["uptime_sec"]))
        for row, bus, src, t, uptime in zip(rows.tolist(), *columns, strict=True):
            node, here = (bus, src), _Uptime(t, uptime)
            if node in self._two or node in self._doubts or here.seconds < self._seconds[_code(node)]:
                yield from self._doubtful(node, here, partial(_place, view, table, row))
            else:
                self._note(node, here)

    def _doubted(self, table: DecodedTable, rows: Array) -> Array:
        """Return rows of nodes whose uptime falls, or that are in doubt; note the last uptime of all others."""
        if not len(rows):
            return rows
        order, first = by_key(table.bus[rows].astype(np.int64) << _NODE_BITS | table.src[rows])
        rows, stop = rows[order], np.append(first[1:], len(rows))
        said, last = table["uptime_sec"][rows].astype(np.int64), rows[stop - 1]
        falls = np.zeros(len(rows), bool)
        np.less(said[1:], said[:-1], out=falls[1:])
        falls[first] = False
        nodes = table.bus[last].astype(np.int64) << _NODE_BITS | table.src[last]
        more = ((int(nodes[-1]) >> _NODE_BITS) + 1 << _NODE_BITS) - len(self._seconds)
        if more > 0:
            self._seconds, self._told = (np.append(known, np.full(more, -1)) for known in (self._seconds, self._told))
        calm = ~np.logical_or.reduceat(falls, first) & (said[first] >= self._seconds[nodes])
        if self._two or self._doubts:
            calm &= ~np.isin(nodes, [_code(node) for node in (*self._two, *self._doubts)])
        self._seconds[nodes[calm]], self._told[nodes[calm]] = said[stop[calm] - 1], table.t[last[calm]]
        return np.sort(rows[np.repeat(~calm, stop - first)])

    def _note(self, node: _Node, here: _Uptime) -> None:
        """Note the last uptime of a node."""
        self._seconds[_code(node)], self._told[_code(node)] = here.seconds, here.t

    def finish(self, _view: View) -> Iterator[Occurrence]:
        """Yield restarts shortly before the end."""
        for found in (*self._restarts, *(doubt.found for doubt in self._doubts.values() if doubt.can)):
            yield self._graded(found)

    def _ripe(self, now: int) -> Iterator[Occurrence]:
        """Yield restarts, once even a request that came out late is known."""
        waiting, self._restarts = self._restarts, []
        for found in waiting:
            if len(waiting) > MOST_RESTARTS or (NO_TIME not in (now, found.t) and now - found.t > ASKED):
                yield self._graded(found)
            else:
                self._restarts.append(found)

    def _graded(self, found: Occurrence) -> Occurrence:
        """Return a restart, as a note if somebody asked for it."""
        asked = self._asked.get((found.bus, found.node or 0), ())
        wanted = any(NO_TIME not in (at, found.t) and 0 <= found.t - at <= ASKED for at in asked)
        return replace(found, severity="note") if wanted else found

    def _doubtful(self, node: _Node, here: _Uptime, place: _Place) -> Iterator[Occurrence]:
        if node in self._two:
            yield from self._of_two(node, here, place)
            if node in self._two:
                return
        doubt = self._doubts.get(node)
        if doubt is not None:
            doubt.seen += 1
            if doubt.new.runs_on(here.t, here.seconds):
                doubt.new, doubt.new_again = here, doubt.new_again + 1
            elif doubt.old.runs_on(here.t, here.seconds):
                doubt.old, doubt.old_again = here, doubt.old_again + 1
            else:
                doubt.seen = PATIENCE
            if doubt.old_again and doubt.new_again:
                del self._doubts[node]
                self._two[node] = [doubt.old, doubt.new]
                now, first = place(), doubt.found
                frames, lines = (*first.frames, *now.frames), (*first.lines, *now.lines)
                yield _two(replace(now, frames=frames, lines=lines, t=first.t), doubt.old, doubt.new)
                return
            if doubt.seen < PATIENCE:
                return
            del self._doubts[node]
            self._note(node, doubt.old if doubt.old_again else doubt.new)
            if doubt.can:
                self._restarts.append(doubt.found)
        self._restart(node, here, place)

    def _of_two(self, node: _Node, here: _Uptime, place: _Place) -> Iterator[Occurrence]:
        """Look at a report while two devices are known; they are forgotten once one of them is gone."""
        two = self._two[node]
        mine = next((k for k in (1, 0) if two[k].runs_on(here.t, here.seconds)), None)
        other = None if mine is None else two[1 - mine]
        if mine is None or other is None or (here.t != NO_TIME and here.t - other.t > EXPIRY):
            del self._two[node]
            self._note(node, here)
            return
        two[mine] = here
        if mine:
            yield _two(place(), *two)

    def _restart(self, node: _Node, here: _Uptime, place: _Place) -> None:
        seconds, told = self._seconds.item(_code(node)), self._told.item(_code(node))
        last = here if seconds < 0 else _Uptime(told, seconds)
        self._note(node, here)
        if here.seconds >= last.seconds or (last.seconds >= WRAP - NEAR_WRAP and here.seconds < NEAR_WRAP):
            return
        values = {"before": last.seconds, "uptime": here.seconds}
        self._doubts[node] = _Doubt(replace(place(), values=values), last, here, last.may_end(here.t, here.seconds))


def _code(node: _Node) -> int:
    """Return a node as one number."""
    return node[0] << _NODE_BITS | node[1]


def _place(view: View, table: DecodedTable, row: int) -> Occurrence:
    """Return where a NodeStatus stands."""
    return breach(view, table, row, "BUS-021", {}, held=True)


def _two(place: Occurrence, old: _Uptime, new: _Uptime) -> Occurrence:
    evidence = f"two uptimes that both run on, {old.seconds} s and {new.seconds} s"
    return replace(place, rule="BUS-010", type="", values={"evidence": evidence})
