"""An index that an ESC was given and confirmed, and the index that it goes on to report with (4.4.2, 4.4.6)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import NO_TIME, SECOND, Occurrence, Rule, breach, usable
from dissectors.tmotor.rules.joined.joins import MOST_UNITS, in_order, units

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import DecodedTable, View

_INDEXES = range(20)
_ANY_UUID, _ANY_INDEX = 0xFFFFFFFF, 0xFF
_ENOUGH = 3  # reports


@dataclass(slots=True)
class _Given:
    """An index that a ParamCfg sets: when, whose."""

    t: int
    index: int
    uuid: int
    before: int

    def meets(self, uuid: int, index: int, confirmed: int) -> bool:
        """Return whether a ParamGet is of the ESC that was addressed and has the new index."""
        mine = (
            self.uuid == uuid if self.uuid != _ANY_UUID else self.before in (_ANY_INDEX, index) or index == self.index
        )
        return mine and self.index in (confirmed, index)


@dataclass(slots=True)
class _Confirmed:
    """An index that a node confirmed: when, where, and how many reports came with others since."""

    t: int
    index: int
    place: Occurrence
    others: int = 0


class AssignedIndex(Rule):
    """Follows each ParamCfg that gives an index to the ParamGet that confirms it, and to the reports behind that."""

    rules = ("BUS-039",)

    def __init__(self) -> None:
        self._given: dict[int, list[_Given]] = {}  # by bus
        self._confirmed: dict[tuple[int, int], _Confirmed] = {}  # by bus and node

    def feed(self, view: View) -> Iterator[Occurrence]:
        """Yield nodes that go on with another index."""
        if view.start == NO_TIME:
            return
        settings, answers, reports = view.table("ParamCfg"), view.table("ParamGet"), view.table("ESCStatus")
        of_nodes: list[int] = []
        if reports is not None and (answers is not None or self._confirmed):
            nodes = set(self._confirmed)
            if answers is not None:
                nodes |= set(zip(answers.bus.tolist(), answers.src.tolist(), strict=True))
            mine = (rows.tolist() for unit, rows in units(view).items() if (unit.bus, unit.node) in nodes)
            of_nodes = [row for rows in mine for row in rows]
        for table, row in in_order((settings, _good(settings)), (answers, _good(answers)), (reports, of_nodes)):
            if table is settings:
                self._ask(table, row)
            elif table is answers:
                self._confirm(view, table, row)
            else:
                yield from self._report(view, table, row)

    def _ask(self, table: DecodedTable, row: int) -> None:
        index, bus = int(table["esc_id_set"][row]), int(table.bus[row])
        if index in _INDEXES and table.t[row] != NO_TIME:
            given = self._given.setdefault(bus, [])
            given.append(_Given(int(table.t[row]), index, int(table["esc_uuid"][row]), int(table["esc_index"][row])))
            del given[:-256]

    def _confirm(self, view: View, table: DecodedTable, row: int) -> None:
        bus, t = int(table.bus[row]), int(table.t[row])
        said = (int(table[name][row]) for name in ("esc_uuid", "esc_index", "esc_id_req"))
        uuid, index, confirmed = said
        limit = view.number("BUS-039", "answer_s") * SECOND
        for one in reversed(self._given.get(bus, [])):
            if 0 <= t - one.t <= limit and one.meets(uuid, index, confirmed):
                key = bus, int(table.src[row])
                if key in self._confirmed and self._confirmed[key].index == one.index:
                    return  # it says so once more
                if key in self._confirmed or len(self._confirmed) < MOST_UNITS:
                    place = breach(view, table, row, "BUS-039", {"given": one.index}, held=True)
                    self._confirmed[key] = _Confirmed(t, one.index, place)
                return

    def _report(self, view: View, table: DecodedTable, row: int) -> Iterator[Occurrence]:
        key = int(table.bus[row]), int(table.src[row])
        known, index = self._confirmed.get(key), int(table["esc_index"][row])
        wait = view.number("BUS-039", "wait_s") * SECOND
        if known is None or table.t[row] - known.t < wait:
            return
        known.others += 1
        if index == known.index:
            del self._confirmed[key]  # it does as it said
        elif known.others >= _ENOUGH:
            del self._confirmed[key]
            values = {**known.place.values, "used": index, "wait_s": wait / SECOND}
            yield replace(known.place, values=values, dialects={"dronecan": None})


def _good(table: DecodedTable | None) -> list[int]:
    rows: list[int] = [] if table is None else np.flatnonzero(usable(table)).tolist()
    return rows
