"""Queries that a node asks again and again and that nobody ever answers, although ESCs live (4.4.2, 4.4.4)."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections import deque
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dissectors.kit import NO_TIME, SECOND, Occurrence, Rule, changes, sound
from dissectors.records import dataclass, field, replace
from dissectors.tmotor.rules.joined.joins import MOST_UNITS, esc_reports
from dissectors.tmotor.rules.packets.carried import (
    ALL_UNITS,
    FIRST_UNIT,
    LONGEST,
    TYPE_IDS,
    carrier,
    occurrence,
    packet_tables,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, DecodedTable, View

_SLOT = SECOND // 2  # in which an ESC is heard or not
_SLOT_BITS = 36  # of all that there are
_SEEN = 3 * SECOND  # before a query
_QUERY_MODE = 0x00
_MOST = 4096  # queries that wait, askers
_NAMED = 4


class _Kind(NamedTuple):
    """A query: what it asks for, the table that has it, and that of answers."""

    what: str
    asked: str
    answer: str


_KINDS = (
    _Kind("FOC parameters (0x1A)", "PUSHSCI.FocQuery", "PUSHCAN.FocFeedback"),
    _Kind("status (0x06, mode 00)", "PUSHSCI.OutputControl", "PUSHCAN.MotorStatus"),
)


class _Query(NamedTuple):
    """One query: who asked which unit when, and its place for the first one of an asker."""

    t: int
    node: int
    unit: int
    place: Occurrence


@dataclass(slots=True)
class _Deaf:
    """An ESC that lived while so many queries came: the first of them, and the time of the last one."""

    first: Occurrence
    last: int
    count: int = 0


@dataclass(slots=True)
class _Asker:
    """One node that asks: the units, the ESCs that do not answer, and whether anybody ever did."""

    answered: bool = False
    asked: dict[int, None] = field(default_factory=dict)
    deaf: dict[int, _Deaf] = field(default_factory=dict)  # by node


class NeverAnswered(Rule):
    """Follows each query until its time is over; what was never answered is told at the end."""

    rules = ("BUS-044",)

    def __init__(self) -> None:
        self._waiting: dict[tuple[int, _Kind], deque[_Query]] = {}
        self._askers: dict[tuple[int, int, _Kind], _Asker] = {}
        self._heard: dict[tuple[int, int, int], list[int]] = {}  # slots in order, by bus, node and unit

    def feed(self, view: View) -> Iterator[Occurrence]:
        """Note who asks, who lives and who answers."""
        if view.start == NO_TIME:
            return
        self._note_living(view)
        for kind in _KINDS:
            self._ask(view, kind)
            self._answer(view, kind)
            self._expire(view, kind, view.end - LONGEST)
        oldest = (view.end - _SEEN - 2 * LONGEST - 2 * self._limit(view)) // _SLOT
        for slots in self._heard.values():
            if slots and slots[0] < oldest:
                del slots[: bisect_left(slots, oldest)]
        yield from ()

    def finish(self, view: View) -> Iterator[Occurrence]:
        """Yield who asked often enough without any answer, of ESCs that know such queries."""
        for kind in _KINDS:
            self._expire(view, kind, view.end)
        least, lasts = (view.number("BUS-044", name) for name in ("least_queries", "lasts_s"))
        for (bus, node, kind), asker in self._askers.items():
            known = {
                who: deaf
                for who, deaf in asker.deaf.items()
                if not view.choice("ESCStatus", "dialect", bus, who).startswith("dronecan")
            }
            if asker.answered or not known:
                continue
            most = max(known.values(), key=lambda deaf: deaf.count)
            seconds = (most.last - most.first.t) / SECOND
            if most.count >= least and seconds >= lasts:
                values = {
                    "asker": node, "what": kind.what, "queries": most.count, "seconds": seconds,
                    "whom": _named(asker.asked), "escs": f"{len(known)} ESC{'' if len(known) == 1 else 's'}",
                }  # fmt: skip
                yield replace(most.first, values=values)

    def _limit(self, view: View) -> int:
        return round(view.number("BUS-044", "timeout_s") * SECOND)

    def _note_living(self, view: View) -> None:
        reports = esc_reports(view)
        if reports is not None:
            unit = FIRST_UNIT + reports.column("esc_index").astype(np.int64)
            self._hear(reports.column("bus"), reports.column("src"), unit, reports.t)
        for table in packet_tables(view):
            if carrier(table) == "PUSHCAN":
                rows = np.flatnonzero(sound(table) & (table.t != NO_TIME))
                self._hear(*(column[rows] for column in (table.bus, table.src, table["unit_id"], table.t)))

    def _hear(self, bus: Array, node: Array, unit: Array, t: Array) -> None:
        """Note the slots in which each unit is heard."""
        if not len(t):
            return
        slots = t // _SLOT
        first = int(slots.min())
        who = bus.astype(np.int64) << 16 | node.astype(np.int64) << 8 | unit
        both = who << _SLOT_BITS | slots - first
        for one in sorted({*both[changes(both, -1)].tolist()}):
            key, slot = one >> _SLOT_BITS, (one & (1 << _SLOT_BITS) - 1) + first
            known = self._heard.get((key >> 16, key >> 8 & 0xFF, key & 0xFF))
            if known is None:
                if len(self._heard) >= MOST_UNITS:
                    continue
                known = self._heard[key >> 16, key >> 8 & 0xFF, key & 0xFF] = []
            at = bisect_left(known, slot) if known and slot <= known[-1] else len(known)
            if known[at : at + 1] != [slot]:
                known.insert(at, slot)

    def _ask(self, view: View, kind: _Kind) -> None:
        table = view.table(kind.asked)
        if table is None:
            return
        asks = sound(table) & (table.t != NO_TIME)
        if "control_mode" in table:
            asks &= table["control_mode"] == _QUERY_MODE
        for row in np.flatnonzero(asks).tolist():
            self._wait(view, table, row, kind)

    def _wait(self, view: View, table: DecodedTable, row: int, kind: _Kind) -> None:
        bus, node, unit = int(table.bus[row]), int(table.src[row]), int(table["unit_id"][row])
        key = bus, node, kind
        if key not in self._askers and len(self._askers) >= _MOST:
            return
        if not self._askers.setdefault(key, _Asker()).answered:
            waiting = self._waiting.setdefault((bus, kind), deque(maxlen=_MOST))
            place = occurrence(view, table, row, "BUS-044", {}, held=True)
            waiting.append(_Query(int(table.t[row]), node, unit, place))

    def _answer(self, view: View, kind: _Kind) -> None:
        """Note the queries that anybody answers; what cannot be read may be an answer."""
        limit, table, transfers = self._limit(view), view.table(kind.answer), view.transfers
        for (bus, which), waiting in self._waiting.items():
            if which is not kind or not waiting:
                continue
            broken = (transfers.kind == 0) & (transfers.type_id == TYPE_IDS["PUSHCAN"]) & (transfers.status != 0)
            t = transfers.t[broken & (transfers.bus == bus)]
            if table is not None:
                t = np.concatenate((t, table.t[sound(table) & (table.bus == bus)]))
            t = np.sort(t[t != NO_TIME])
            for query in waiting if len(t) else ():
                at = int(np.searchsorted(t, query.t))
                if at < len(t) and t[at] <= query.t + limit:
                    self._askers[bus, query.node, kind].answered = True

    def _expire(self, view: View, kind: _Kind, end: int) -> None:
        """Count the queries that had their time, for each ESC that lived before and after them."""
        limit = self._limit(view)
        for (bus, which), waiting in self._waiting.items():
            while which is kind and waiting and waiting[0].t + limit <= end:
                query = waiting.popleft()
                asker = self._askers[bus, query.node, kind]
                if asker.answered or view.paused(query.t, query.t + limit):
                    continue
                for node in self._living(bus, query, limit):
                    deaf = asker.deaf.setdefault(node, _Deaf(query.place, query.t))
                    deaf.count, deaf.last = deaf.count + 1, query.t
                    if len(asker.asked) <= _NAMED:
                        asker.asked[query.unit] = None

    def _living(self, bus: int, query: _Query, limit: int) -> set[int]:
        """Return the nodes of a unit that were heard before a query, and after it while an answer was due."""
        now = query.t // _SLOT
        found = set()
        for (where, node, unit), slots in self._heard.items():
            if where == bus and query.unit in (unit, ALL_UNITS):
                before, after = (bisect_left(slots, one) for one in ((query.t - _SEEN) // _SLOT, now + 1))
                if before < bisect_left(slots, now) and after < bisect_right(slots, (query.t + limit) // _SLOT):
                    found.add(node)
        return found


def _named(asked: dict[int, None]) -> str:
    if ALL_UNITS in asked:
        return "all units"
    names = ", ".join(f"0x{unit:02X}" for unit in sorted(asked)[:_NAMED])
    return f"unit {names}{', ...' if len(asked) > _NAMED else ''}"
