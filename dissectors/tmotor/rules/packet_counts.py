"""PUSH-009: the frame count of packets goes on by 1 (4.4.4, 4.4.5, frame count rows).

The document does not say whether all packets of a unit share a count or each frame ID has its own. Where the two
readings differ, the first packets decide; until then both are kept.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dissectors.conformance import NO_TIME, SECOND, Watcher
from dissectors.tmotor.rules.packet_losses import Before, Gaps, Losses
from dissectors.tmotor.rules.packets import carrier, occurrence, packet_tables, place, unit_key

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.conformance import Occurrence, Table, View
    from dissectors.tmotor.rules.packet_losses import Past

_DECIDES = 32  # packets, from the first in which the two readings differ
_MOST_UNITS = 4096
_MOST_HELD = 8192
_LATE = 5 * SECOND  # a broken transfer comes out 2.0 s after its start, or somewhat later
_IDS = 32
_NEAR = 8  # so far a transfer may come too late
_FEW = 3  # a longer step to transfer ID 0 is a restart
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


class _Doubt(NamedTuple):
    """A packet that breaks a count unless a loss between its transfer and the one before explains it."""

    one: Occurrence
    between: tuple[int, int]
    missing: int


class _Held(NamedTuple):
    """A hit that waits for what may explain it, by either reading."""

    t: int
    carrier: str
    key: int
    by_unit: int
    by_id: int | None
    doubts: tuple[_Doubt | None, _Doubt | None]


class Counts(Watcher):
    """Follows the counts of every node, carrier and unit."""

    rules = ("PUSH-009",)

    def __init__(self) -> None:
        """Nothing seen yet."""
        self._losses = Losses()
        self._gaps = Gaps()
        self._before = Before()
        self._scopes: dict[tuple[str, int], _Scope] = {}
        self._held: deque[_Held] = deque()

    def look(self, view: View) -> Iterator[Occurrence]:
        """Steps that are not 1, and that nothing explains."""
        self._losses.add(view)
        self._gaps.add(view)
        tables = list(packet_tables(view))
        if tables:
            hits = sorted((hit for table in tables for hit in _hits(table)), key=lambda hit: hit.place)
            if hits:
                past = self._before.beside(view.transfers, tables)
                for hit in hits:
                    self._hold(view, hit, past)
                    yield from self._release(int(hit.table.t[hit.row]))
            self._before.keep(view.transfers, tables)
        yield from self._release(view.end)
        self._losses.forget()

    def settle(self, _view: View) -> Iterator[Occurrence]:
        """Units with few packets are decided by what there was."""
        while self._held:
            yield from self._judge(self._held.popleft())
        for scope in self._scopes.values():
            yield from scope.decide()

    def _hold(self, view: View, hit: _Hit, past: Past) -> None:
        """Keeps a hit that may be a breach, or that helps to choose a reading."""
        name, key = carrier(hit.table), hit.key
        scope = self._scopes.get((name, key))
        if scope is None:
            if len(self._scopes) >= _MOST_UNITS:
                return
            scope = self._scopes.setdefault((name, key), _Scope())
        unit = same = None
        if scope.chosen != _ID:
            unit = self._doubt(view, hit, hit.by_unit, past, _UNIT)
        if scope.chosen != _UNIT and hit.by_id is not None:
            same = self._doubt(view, hit, hit.by_id, past, _ID)
        if unit or same or not scope.chosen:
            self._held.append(_Held(int(hit.table.t[hit.row]), name, key, hit.by_unit, hit.by_id, (unit, same)))

    def _release(self, end: int) -> Iterator[Occurrence]:
        """Judges what nothing that comes out after a time can explain."""
        while self._held and (len(self._held) > _MOST_HELD or (end != NO_TIME and self._held[0].t < end - _LATE)):
            yield from self._judge(self._held.popleft())

    def _judge(self, held: _Held) -> Iterator[Occurrence]:
        scope = self._scopes[held.carrier, held.key]
        unit, same = (self._unexplained(held, doubt) for doubt in held.doubts)
        if scope.chosen or (held.by_unit == held.by_id and not scope.held):
            chosen = same if scope.chosen == _ID else unit
            if chosen is not None:
                yield chosen
            return
        scope.by_unit += held.by_unit == 1
        scope.by_id += held.by_id == 1
        scope.held.append((unit, same))
        if len(scope.held) >= _DECIDES:
            yield from scope.decide()

    def _unexplained(self, held: _Held, doubt: _Doubt | None) -> Occurrence | None:
        if doubt is None or self._losses.explain(held.carrier, held.key >> 8, doubt.between, doubt.missing):
            return None
        return doubt.one

    def _doubt(self, view: View, hit: _Hit, step: int, past: Past, scope: str) -> _Doubt | None:
        table, row, t = hit.table, hit.row, view.transfers
        at = int(table.row[row])
        if step == 1 or _restarted(view, at) or _overtaken(view, at, step):
            return None
        if step == 0 and t.has("step")[at] and t.step[at] == 0:
            return None
        names = [table.name] if scope == _ID else past.names(carrier(table))
        before, lead = past.before(names, hit.key, hit.place)
        between, missing = (lead, t.frames(at)[0]), (step - 1) % 256
        known = self._losses.explain(carrier(table), hit.key >> 8, between, missing)
        if known or self._gaps.between(before, hit.place >> 16):
            return None
        value = int(table["frame_count"][row])
        values = {"expected": (value - step + 1) % 256, "value": value, "scope": scope}
        return _Doubt(occurrence(view, table, row, "PUSH-009", values, held=True, drops=True), between, missing)


def _hits(table: Table) -> Iterator[_Hit]:
    step, step_id, known = table["count_step"], table["count_step_id"], table.has("count_step_id")
    fits = (step == 1) & (step_id == 1) & known
    if fits.all():
        return
    rows = np.flatnonzero(~fits & table.has("count_step") & table.trusted)
    places, keys = place(table)[rows].tolist(), unit_key(table)[rows].tolist()
    for k, row in enumerate(rows.tolist()):
        yield _Hit(places[k], table, row, keys[k], int(step[row]), int(step_id[row]) if known[row] else None)


def _restarted(view: View, row: int) -> bool:
    """Whether the transfer IDs of its session say that the node has restarted."""
    t = view.transfers
    return bool(t.transfer_id[row] == 0 and t.has("step")[row] and t.step[row] > _FEW)


def _overtaken(view: View, row: int, step: int) -> bool:
    """Whether its transfer goes as far back as its count: it came behind one that was sent after it."""
    t, back = view.transfers, 256 - step
    return bool(back <= _NEAR and t.has("step")[row] and t.step[row] == _IDS - back)


WATCHERS: tuple[type[Watcher], ...] = (Counts,)
