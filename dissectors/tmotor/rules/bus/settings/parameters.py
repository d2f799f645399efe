"""The fate of ParamCfg: whether the addressed ESC answers, and with the values that were set."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import NO_TIME, SECOND, Rule, breach, by_key, usable
from dissectors.records import dataclass, field, replace
from dissectors.tmotor.rules.joined.joins import MOST_UNITS, end, units

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from dissectors.kit import DecodedTable, Occurrence, Occurrences, View
    from dissectors.tmotor.rules.joined.joins import ReportingEsc

_ANY_UUID, _ANY_INDEX = 0xFFFFFFFF, 0xFF
_OPEN8, _OPEN16, _AMBIGUOUS = 0xFF, 0xFFFF, 0x00FF
_LATE = 5 * SECOND // 2  # a damaged answer comes out 2.0 s after its start
_ANSWER = 1332  # type ID of ParamGet (4.3.1)
_BROKEN = -1  # stands for the table of a damaged answer
_SEVERAL = 2  # ESCs that share a supply: one alone may have failed
MOST_PENDING = 256
MOST_UUIDS = 4096
_MOST_HOLDERS = 16  # nodes of one UUID
_NEVER = 1 << 62
# Fields that are set and reported under one name, with what stands for "no change", 4.4.2.
_FIELDS: Mapping[str, tuple[int, ...]] = {
    "esc_ov_threshold": (_OPEN16, _AMBIGUOUS),
    "esc_oc_threshold": (_OPEN16, _AMBIGUOUS),
    "esc_ot_threshold": (_OPEN16, _AMBIGUOUS),
    "esc_acc_threshold": (_OPEN16, _AMBIGUOUS),
    "esc_dacc_threshold": (_OPEN16, _AMBIGUOUS),
    "esc_rotate_dir": (-1, _AMBIGUOUS),
    "esc_timing": (_OPEN8,),
    "esc_signal_priority": (_OPEN8,),
    "esc_led_mode": (_OPEN16, _AMBIGUOUS),
    "esc_can_rate": (_OPEN8,),
    "esc_fdb_rate": (_OPEN16, _AMBIGUOUS),
    "esc_save_option": (_OPEN8,),
}
_ID = "esc_id_set"


@dataclass(slots=True)
class _Asked:
    """A ParamCfg; `t` is its end, `query` whether all its bytes are 0xFF.

    `answered` are the nodes that sent a ParamGet, `expected` those that have to after a query to all. `living` is
    whether an ESC reported shortly before, of those that had reported at all: that with the address, if it is known;
    `resting` whether several did, and no motor turned; `heard` whether any did shortly behind it.
    """

    t: int
    bus: int
    place: Occurrence
    uuid: int
    index: int
    sets: dict[str, int]
    query: bool
    answered: set[int] = field(default_factory=set)
    expected: tuple[int, ...] = ()
    living: bool = True
    resting: bool = False
    heard: bool = False

    @property
    def address(self) -> str:
        if self.uuid != _ANY_UUID:
            return f"uuid {self.uuid:08X}"
        return "any ESC" if self.index == _ANY_INDEX else f"index {self.index}"

    def meets(self, got: Mapping[str, int]) -> bool:
        """Return whether a ParamGet comes from the ESC that was addressed; an index may be the new one already."""
        if self.uuid != _ANY_UUID:
            return got["esc_uuid"] == self.uuid
        new = self.sets.get(_ID, self.index)
        return self.index == _ANY_INDEX or got["esc_index"] in (self.index, new)

    def may_come_from(self, indexes: set[int], uuids: set[int]) -> bool:
        """Return whether an answer that cannot be read may be meant: its sender is not known to be another ESC."""
        if self.query:
            return True
        if self.uuid != _ANY_UUID:
            return not uuids or self.uuid in uuids
        return not indexes or self.index == _ANY_INDEX or bool(indexes & {self.index, self.sets.get(_ID, self.index)})


class Dialogue(Rule):
    """Follows every ParamCfg until its time is over; at most 256 at a time."""

    rules = ("BUS-011", "BUS-012", "BUS-013", "BUS-015")

    def __init__(self) -> None:
        self._pending: deque[_Asked] = deque()
        self._seen: dict[tuple[int, int], tuple[int, bool]] = {}  # (bus, node): last ESCStatus, and if its motor stood
        self._since: dict[tuple[int, int], int] = {}  # of the first one
        self._units: dict[ReportingEsc, int] = {}  # time of the first ESCStatus
        self._holders: dict[int, set[tuple[int, int]]] = {}  # bus and node of each UUID
        self._answered_at: dict[tuple[int, int], int] = {}  # of the first ParamGet
        self._uuids: dict[int, set[int]] = {}  # the indexes that each UUID was seen with

    def feed(self, view: View) -> Iterable[Occurrences | Occurrence]:
        """Follow the messages of both kinds in order; deadlines stand in between and behind."""
        if view.start == NO_TIME:
            return
        settings, parameters = view.table("ParamCfg"), view.table("ParamGet")
        self._note_first(view)
        if settings is not None or self._pending:
            yield from self._follow(view, settings, parameters)
        elif parameters is not None:
            self._note_all(view, parameters)
        for unit, rows in units(view).items():
            reports = view.table("ESCStatus")
            if reports is not None and (unit.bus, unit.node) in self._since:
                last = int(reports.t[rows[-1]]), not reports["rpm"][rows[-1]]
                self._seen[unit.bus, unit.node] = max(self._seen.get((unit.bus, unit.node), last), last)
        for asked in self._pending:
            self._look_behind(view, asked)
        yield from self._due(view, view.end)

    def _follow(
        self, view: View, settings: DecodedTable | None, parameters: DecodedTable | None
    ) -> Iterator[Occurrence]:  # fmt: skip
        """Follow questions and answers in their order."""
        tables = [table for table in (settings, parameters) if table is not None]
        heard = [] if parameters is None else _heads(parameters)
        for number, k, row, t, good in _in_order(view, tables):
            if self._pending:
                yield from self._due(view, t)
            if k == _BROKEN:
                self._hear_some(view, row)
            elif tables[k] is settings:
                self._ask(view, tables[k], (row, number, t), good=good)
            elif good:
                yield from self._hear(view, tables[k], (row, t, *heard[row]))

    def _note_first(self, view: View) -> None:
        """Note when each node first sent ESCStatus."""
        for unit, rows in units(view).items():
            who, reports = (unit.bus, unit.node), view.table("ESCStatus")
            if reports is not None and (who in self._since or len(self._since) < MOST_UNITS):
                first = int(end(view, reports, rows[:1])[0])
                self._since[who] = min(self._since.get(who, first), first)
                if unit in self._units or len(self._units) < MOST_UNITS:
                    self._units[unit] = min(self._units.get(unit, first), first)

    def finish(self, view: View) -> Iterable[Occurrences | Occurrence]:
        """Yield what nobody answered up to the end."""
        if view.end != NO_TIME:
            yield from self._due(view, view.end + _LATE)

    def _ask(self, view: View, table: DecodedTable, what: tuple[int, int, int], *, good: bool) -> None:
        row, number, t = what
        bus = int(table.bus[row])
        if not good or len(self._pending) >= MOST_PENDING:
            return
        sets = {name: int(table[name][row]) for name, skip in _FIELDS.items() if int(table[name][row]) not in skip}
        open_ = all(int(table[name][row]) == skip[0] for name, skip in _FIELDS.items())
        if int(table[_ID][row]) not in (_OPEN16, _AMBIGUOUS):
            sets[_ID] = int(table[_ID][row])
        place = breach(view, table, row, "", {}, held=True)
        uuid, index = int(table["esc_uuid"][row]), int(table["esc_index"][row])
        query = open_ and (uuid, index, int(table[_ID][row])) == (_ANY_UUID, _ANY_INDEX, _OPEN16)
        asked = _Asked(t, bus, place, uuid, index, sets, query)
        reporting = dict(self._reporting(view, bus, number, t))
        asked.expected = tuple(sorted(reporting)) if query else ()
        asked.resting = len(reporting) >= _SEVERAL and all(reporting.values())
        known = self._addressed(asked)
        anybody = any(who[0] == bus and first <= t for who, first in self._since.items())
        asked.living = bool(known & reporting.keys()) if known else bool(reporting) or not anybody
        self._pending.append(asked)

    def _addressed(self, asked: _Asked) -> set[int]:
        """Return the nodes that had reported and are known to have the address of a request; none for any ESC."""
        if asked.uuid != _ANY_UUID:
            holders = self._holders.get(asked.uuid, ())
            return {who[1] for who in holders if who[0] == asked.bus and self._since.get(who, _NEVER) <= asked.t}
        found = (unit for unit, first in self._units.items() if first <= asked.t and unit.bus == asked.bus)
        return {unit.node for unit in found if unit.index == asked.index}

    def _reporting(self, view: View, bus: int, number: int, t: int) -> Iterator[tuple[int, bool]]:
        """Yield nodes that have sent ESCStatus shortly before a transfer, and whether their motors stood then."""
        window = round(view.number("BUS-012", "seen_s") * SECOND)
        last = {node: seen for (where, node), seen in self._seen.items() if where == bus}
        table = view.table("ESCStatus")
        for unit, rows in units(view).items():
            if table is not None and unit.bus == bus:
                before = int(np.searchsorted(table["transfer"][rows].astype(np.int64), number))
                if before:
                    row = rows[before - 1]
                    report = int(table.t[row]), not table["rpm"][row]
                    last[unit.node] = max(report, last.get(unit.node, report))
        yield from ((node, stood) for node, (seen, stood) in last.items() if t - seen <= window)

    def _look_behind(self, view: View, asked: _Asked) -> None:
        """Note whether an ESC reports shortly behind a request; what a batch has of that is looked up once."""
        until = asked.t + round(view.number("BUS-012", "seen_s") * SECOND)
        table = view.table("ESCStatus")
        for unit, rows in units(view).items():
            if table is not None and unit.bus == asked.bus and not asked.heard:
                t = table.t[rows]
                asked.heard = bool(((t > asked.t) & (t <= until)).any())

    def _hear_some(self, view: View, row: int) -> None:
        """Note a damaged ParamGet: nobody knows what it answers, but it was an answer."""
        transfers = view.transfers
        node = int(transfers.src[row])
        bus, t = int(transfers.bus[row]), int(transfers.t[row])
        own = {unit.index for unit, first in self._units.items() if (unit.bus, unit.node) == (bus, node) and first <= t}
        uuids = {uuid for uuid, holders in self._holders.items() if (bus, node) in holders}
        for one in self._waiting(view, bus, node, t):
            if one.may_come_from(own, uuids):
                one.answered.add(node)

    def _note_all(self, view: View, table: DecodedTable) -> None:
        """Note who sends what, of each the first one: nothing waits for an answer."""
        rows = np.flatnonzero(usable(table))
        who = table.bus[rows].astype(np.int64) << 48 | table.src[rows].astype(np.int64) << 40
        order, begins = by_key(who | table["esc_uuid"][rows].astype(np.int64) << 8 | table["esc_index"][rows])
        first = np.sort(rows[order[begins]])
        cells = (column[first].tolist() for column in (table.bus, table.src, table["esc_uuid"], table["esc_index"]))
        for t, bus, node, uuid, index in zip(end(view, table, first).tolist(), *cells, strict=True):
            self._note((bus, node), t, uuid, index)

    def _note(self, who: tuple[int, int], t: int, uuid: int, index: int) -> None:
        if uuid in self._uuids or len(self._uuids) < MOST_UUIDS:
            self._uuids.setdefault(uuid, set()).add(index)
            if len(self._holders.setdefault(uuid, set())) < _MOST_HOLDERS:
                self._holders[uuid].add(who)
        self._answered_at.setdefault(who, t)

    def _hear(self, view: View, table: DecodedTable, what: tuple[int, ...]) -> Iterator[Occurrence]:
        row, t, bus, node, start, uuid, index = what
        self._note((bus, node), t, uuid, index)
        if not self._pending:
            return
        got = {name: int(table[name][row]) for name in ("esc_index", "esc_uuid", "esc_id_req", *_FIELDS)}
        waiting = [one for one in self._waiting(view, bus, node, start) if one.meets(got)]
        if waiting:
            waiting[0].answered.add(node)
            later = {name for one in waiting[1:] for name in one.sets}
            for name, expected in waiting[0].sets.items():
                if name not in later and (wrong := _differs(name, expected, got)) is not None:
                    values = {"field": name, "expected": expected, "value": wrong}
                    yield breach(view, table, row, "BUS-013", values)

    def _waiting(self, view: View, bus: int, node: int, start: int) -> list[_Asked]:
        """Return requests that a node may answer at a time, the first one first."""
        limit = max(_limits(view).values()) * SECOND
        return [
            one for one in self._pending if one.bus == bus and node not in one.answered and start - one.t <= limit
        ]  # fmt: skip

    def _due(self, view: View, t: int) -> Iterator[Occurrence]:
        """Judge what has waited long enough; requests stay until every rule's time is over."""
        limits = _limits(view)
        while self._pending and t - self._pending[0].t > max(limits.values()) * SECOND + _LATE:
            asked = self._pending.popleft()
            self._look_behind(view, asked)
            if not view.paused(asked.t, asked.t + round(max(limits.values()) * SECOND)):
                yield from self._judged(asked, limits)

    def _judged(self, asked: _Asked, limits: Mapping[str, float]) -> Iterator[Occurrence]:
        place = asked.place
        if asked.expected:
            for node in asked.expected:
                if node not in asked.answered:
                    values = {"missing_node": node, "limit_s": limits["BUS-012"]}
                    yield replace(
                        place, rule="BUS-012", node=node, values=values, dialects={"dronecan": None}, drops=True,
                        until=asked.t + round(limits["BUS-012"] * SECOND),
                    )  # fmt: skip
        elif not asked.answered and not asked.query and asked.living and (asked.heard or not asked.resting):
            until = asked.t + round(limits["BUS-011"] * SECOND)
            unanswered: dict[str, object] = {"address": asked.address, "limit_s": limits["BUS-011"]}
            yield replace(place, rule="BUS-011", values=unanswered, drops=True, until=until)
        what = self._unknown(asked)
        if what:
            yield replace(place, rule="BUS-015", values={"uuid": asked.uuid, "esc_index": asked.index, "what": what})

    def _unknown(self, asked: _Asked) -> str:
        """Return what is wrong with an address, as far as is known; empty if nothing is."""
        if asked.uuid == _ANY_UUID:
            return ""
        reporting = {who for who, first in self._since.items() if who[0] == asked.bus and first <= asked.t + SECOND}
        complete = bool(reporting) and all(who in self._answered_at for who in reporting)
        if asked.uuid not in self._uuids:
            return "no ESC has this uuid" if complete else ""
        indexes = self._uuids[asked.uuid]
        if asked.index == _ANY_INDEX or asked.index in indexes:
            return ""
        others = [uuid for uuid, shown in self._uuids.items() if asked.index in shown]
        return f"that index has uuid {min(others):08X}" if others else ""


def _limits(view: View) -> dict[str, float]:
    """Return how long each rule waits for answers, in s."""
    wanted = (("BUS-011", "timeout_s"), ("BUS-012", "timeout_s"), ("BUS-015", "wait_s"))
    return {rule: view.number(rule, name) for rule, name in wanted}


def _in_order(view: View, tables: Sequence[DecodedTable]) -> list[tuple[int, int, int, int, bool]]:
    """Return number of the transfer, which table, row, time of the last frame and whether it is usable, of all rows."""
    order: list[tuple[int, int, int, int, bool]] = []
    for k, table in enumerate(tables):
        columns = table["transfer"], end(view, table, np.arange(len(table))), usable(table)
        lists = (column.tolist() for column in columns)
        order += ((number, k, row, t, good) for row, (number, t, good) in enumerate(zip(*lists, strict=True)))
    t = view.transfers
    damaged = np.flatnonzero((t.type_id == _ANSWER) & (t.kind == 0) & (t.status != 0)).tolist()
    order += ((t.first + row, _BROKEN, row, int(t.t_end[row]), False) for row in damaged)
    return sorted(order)


def _heads(table: DecodedTable) -> list[tuple[int, ...]]:
    """Return bus, node, time, UUID and index of each ParamGet."""
    columns = table.bus, table.src, table.t, table["esc_uuid"], table["esc_index"]
    return list(zip(*(column.tolist() for column in columns), strict=True))


def _differs(name: str, expected: int, got: Mapping[str, int]) -> int | None:
    """Return the reported value if it is not the expected one."""
    if name == _ID:
        return None if expected in (got["esc_id_req"], got["esc_index"]) else got["esc_id_req"]
    return None if got[name] == expected else got[name]
