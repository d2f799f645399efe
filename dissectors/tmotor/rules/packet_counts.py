"""PUSH-009: the frame count of packets goes on by 1 (4.4.4, 4.4.5, frame count rows).

The document does not say whether all packets of a unit share a count or each frame ID has its own. Where the two
readings differ, the first packets decide; until then both are kept.
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dissectors.conformance import Watcher
from dissectors.tmotor.rules.packets import (
    HEADERS,
    TYPE_IDS,
    UNRECOGNIZED,
    carrier,
    occurrence,
    packet_tables,
    place,
    unit_key,
)
from dissectors.tmotor.rules.rows import sender
from dissectors.tmotor.rules.series import Latest

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from dissectors.conformance import Occurrence, Table, View, Words

_DECIDES = 32  # packets, from the first in which the two readings differ
_MOST_UNITS = 4096
_MOST_LOSSES = 256  # remembered of a session
_BROKEN = -1
_UNIT, _ID = "unit", "frame ID"


@dataclass(slots=True)
class _Scope:
    """What shows how one unit counts: packets that fit one reading only, and what either would report."""

    chosen: str = ""
    by_unit: int = 0
    by_id: int = 0
    held: list[tuple[Occurrence | None, Occurrence | None]] = field(default_factory=list)

    def decide(self) -> Iterator[Occurrence]:
        """Takes the reading that fits more packets, the common count in doubt; what that one reports."""
        self.chosen = _ID if self.by_id > self.by_unit else _UNIT
        for pair in self.held:
            if (one := pair[self.chosen == _ID]) is not None:
                yield one
        self.held = []


class _Hit(NamedTuple):
    """A packet whose steps are not both 1; `by_id` is None for the first of its frame ID."""

    place: int
    table: Table
    row: int
    key: int
    by_unit: int
    by_id: int | None

    @property
    def node(self) -> int:
        """Bus and source."""
        return self.key >> 8


class Losses:
    """Transfers that a session lost, by the number of the one after them: how many, or `_BROKEN` for a damaged one."""

    def __init__(self) -> None:
        self._lost: dict[tuple[str, int], list[tuple[int, int]]] = {}

    def add(self, view: View) -> None:
        """What a batch lost: transfer IDs left out, damaged transfers, and packets that cannot be read."""
        found: list[tuple[str, int, int, int]] = []
        t = view.transfers
        rows = np.flatnonzero((t.type_id | 1) == TYPE_IDS["PUSHCAN"])  # the other one is 1 below
        if rows.size:
            gone = np.where(t.has("step")[rows], t.step[rows].astype(np.int64) - 1, 0)
            broken = t.status[rows] != 0
            for k in np.flatnonzero((t.kind[rows] == 0) & ((gone > 0) | broken)).tolist():
                row = int(rows[k])
                name = "PUSHCAN" if t.type_id[row] == TYPE_IDS["PUSHCAN"] else "PUSHSCI"
                node = int(t.bus[row]) << 7 | int(t.src[row])
                if gone[k] > 0:
                    found.append((name, node, t.first + row, int(gone[k])))
                if broken[k]:
                    found.append((name, node, t.first + row, _BROKEN))
        for name in HEADERS:
            rest = view.table(f"{name}.{UNRECOGNIZED}")
            if rest is not None:
                numbers = rest["transfer"].tolist()
                found += [(name, node, number, 1) for node, number in zip(sender(rest).tolist(), numbers, strict=True)]
        for name, node, number, lost in sorted(found, key=lambda one: one[2]):
            losses = self._lost.setdefault((name, node), [])
            losses.append((number, lost))
            del losses[:-_MOST_LOSSES]

    def explain(self, name: str, node: int, between: tuple[int, int], missing: int) -> bool:
        """Whether so many packets may have been lost after the first of two transfers, up to the second."""
        losses = self._lost.get((name, node), [])
        low, high = (bisect_right(losses, number, key=lambda one: one[0]) for number in between)
        lost = [count for _, count in losses[low:high]]
        return _BROKEN in lost or 0 < missing <= sum(lost)


class Counts(Watcher):
    """Follows the counts of every node, carrier and unit."""

    rules = ("PUSH-009",)

    def __init__(self) -> None:
        """Nothing seen yet."""
        self._losses = Losses()
        self._last: dict[str, Latest] = {}
        self._scopes: dict[tuple[str, int], _Scope] = {}

    def look(self, view: View) -> Iterator[Occurrence]:
        """Steps that are not 1, and that nothing explains."""
        self._losses.add(view)
        tables = list(packet_tables(view))
        if not tables:
            return
        hits = sorted((hit for table in tables for hit in _hits(table)), key=lambda hit: hit.place)
        if hits:
            past = _Past(tables, self._last)
            for hit in hits:
                yield from self._judge(view, hit, past)
        for table in tables:
            self._last.setdefault(table.name, Latest()).keep(unit_key(table), place(table))

    def settle(self, _view: View) -> Iterator[Occurrence]:
        """Units with few packets are decided by what there was."""
        for scope in self._scopes.values():
            yield from scope.decide()

    def _judge(self, view: View, hit: _Hit, past: _Past) -> Iterator[Occurrence]:
        table, key, by_unit, by_id = hit.table, hit.key, hit.by_unit, hit.by_id
        scope = self._scopes.get((carrier(table), key))
        if scope is None:
            if len(self._scopes) >= _MOST_UNITS:
                return
            scope = self._scopes.setdefault((carrier(table), key), _Scope())
        every = [name for name in past.names if name.startswith(f"{carrier(table)}.")]
        one = self._occurrence(view, hit, by_unit, past.before(every, key, hit.place), scope.chosen or _UNIT)
        if by_unit == by_id and (scope.chosen or not scope.held):
            if one is not None:
                yield one
            return
        same = past.before([table.name], key, hit.place)
        other = None if by_id is None else self._occurrence(view, hit, by_id, same, _ID)
        if scope.chosen:
            chosen = other if scope.chosen == _ID else one
            if chosen is not None:
                yield chosen
            return
        scope.by_unit += by_unit == 1
        scope.by_id += by_id == 1
        scope.held.append((_with_lines(one, view), _with_lines(other, view)))
        if len(scope.held) >= _DECIDES:
            yield from scope.decide()

    def _occurrence(self, view: View, hit: _Hit, step: int, before: int, scope: str) -> Occurrence | None:
        table, row = hit.table, hit.row
        at = int(table.row[row])
        if step == 1:
            return None
        repeated = step == 0 and view.transfers.has("step")[at] and view.transfers.step[at] == 0
        between = before >> 16, hit.place >> 16
        if repeated or self._losses.explain(carrier(table), hit.node, between, (step - 1) % 256):
            return None
        value = int(table["frame_count"][row])
        values = {"expected": (value - step + 1) % 256, "value": value, "scope": scope}
        return replace(occurrence(view, table, row, "PUSH-009", values), drops=True)


class _Past:
    """Where each unit's packet before a place was, in this batch or an earlier one."""

    def __init__(self, tables: Sequence[Table], last: dict[str, Latest]) -> None:
        self._tables = {table.name: (unit_key(table), place(table)) for table in tables}
        self._last = last
        self._places: dict[tuple[str, int], Words] = {}
        self.names = sorted({*self._tables, *last})

    def before(self, names: Iterable[str], key: int, at: int) -> int:
        """The latest place of a unit's packet among some tables."""
        return max(self._before(name, key, at) for name in names)

    def _before(self, name: str, key: int, at: int) -> int:
        if (name, key) not in self._places:
            keys, places = self._tables.get(name, (np.empty(0), np.empty(0)))
            self._places[name, key] = places[keys == key]
        places = self._places[name, key]
        found = int(np.searchsorted(places, at)) - 1
        if found >= 0:
            return int(places[found])
        return self._last[name].get(key) if name in self._last else 0


def _hits(table: Table) -> Iterator[_Hit]:
    step, step_id, known = table["count_step"], table["count_step_id"], table.has("count_step_id")
    fits = (step == 1) & (step_id == 1) & known
    if fits.all():
        return
    rows = np.flatnonzero(~fits & table.has("count_step") & table.trusted)
    places, keys = place(table)[rows].tolist(), unit_key(table)[rows].tolist()
    for k, row in enumerate(rows.tolist()):
        yield _Hit(places[k], table, row, keys[k], int(step[row]), int(step_id[row]) if known[row] else None)


def _with_lines(one: Occurrence | None, view: View) -> Occurrence | None:
    return one and replace(one, lines=view.lines(one.frames))


WATCHERS: tuple[type[Watcher], ...] = (Counts,)
