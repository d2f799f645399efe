"""An index that an ESC was given and confirmed, and the index that it goes on to report with (4.4.2, 4.4.6)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import NO_TIME, SECOND, Occurrence, Rule, breach, usable
from dissectors.records import dataclass, replace
from dissectors.tmotor.rules.joined.joins import MOST_UNITS, in_order, units

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, DecodedTable, View

_INDEXES = range(20)
_ANY_UUID, _ANY_INDEX = 0xFFFFFFFF, 0xFF
_ENOUGH = 3  # reports
_END = 1 << 62  # behind every transfer


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
        settings, answers = view.table("ParamCfg"), view.table("ParamGet")
        found: list[tuple[int, Occurrence]] = []
        reports, asked = _Reports(view), _good(settings)
        for table, row in in_order((settings, asked), (answers, self._timely(view, answers, settings, asked))):
            if table is settings:
                self._ask(table, row)
            else:
                node = int(table.bus[row]), int(table.src[row])
                found += self._compare(view, node, reports.until(node, int(table["transfer"][row])))
                self._confirm(view, table, row)
        for node in list(self._confirmed):
            found += self._compare(view, node, reports.until(node, _END))
        yield from (one for _, one in sorted(found, key=lambda told: told[0]))

    def _timely(
        self, view: View, answers: DecodedTable | None, settings: DecodedTable | None, asked: Array
    ) -> Array:  # fmt: skip
        """Return answers that do not come too late behind the latest request of any bus."""
        latest = max((one.t for given in self._given.values() for one in given), default=NO_TIME)
        if settings is not None and len(asked):
            latest = max(latest, int(settings.t[asked].max()))
        if answers is None or latest == NO_TIME:
            return np.empty(0, np.int64)
        rows = _good(answers)
        return rows[answers.t[rows] <= latest + self._limit(view)]

    def _limit(self, view: View) -> float:
        return view.number("BUS-039", "answer_s") * SECOND

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
        for one in reversed(self._given.get(bus, [])):
            if 0 <= t - one.t <= self._limit(view) and one.meets(uuid, index, confirmed):
                key = bus, int(table.src[row])
                if key in self._confirmed and self._confirmed[key].index == one.index:
                    return  # it says so once more
                if key in self._confirmed or len(self._confirmed) < MOST_UNITS:
                    place = breach(view, table, row, "BUS-039", {"given": one.index}, held=True)
                    self._confirmed[key] = _Confirmed(t, one.index, place)
                return

    def _compare(
        self, view: View, node: tuple[int, int], reports: tuple[Array, Array, Array]
    ) -> Iterator[tuple[int, Occurrence]]:
        """Yield what the next reports of a node say of the index that it confirmed, with the transfer that says it."""
        known = self._confirmed.get(node)
        if known is None:
            return
        wait = view.number("BUS-039", "wait_s") * SECOND
        number, t, indexes = reports
        for k in np.flatnonzero(t - known.t >= wait)[: _ENOUGH - known.others].tolist():
            known.others += 1
            index = int(indexes[k])
            if index != known.index and known.others < _ENOUGH:
                continue
            del self._confirmed[node]
            if index != known.index:
                values = {**known.place.values, "used": index, "wait_s": wait / SECOND}
                yield int(number[k]), replace(known.place, values=values, dialects={"dronecan": None})
            return


class _Reports:
    """The reports of each node in a batch, put in order once they are asked for."""

    def __init__(self, view: View) -> None:
        self._view = view
        self._rest: dict[tuple[int, int], tuple[Array, Array, Array]] = {}

    def until(self, node: tuple[int, int], transfer: int) -> tuple[Array, Array, Array]:
        """Return transfers, times and indexes of those before a transfer that were not returned yet."""
        number, t, index = self._rest[node] if node in self._rest else self._of(node)
        stop = int(np.searchsorted(number, transfer))
        self._rest[node] = number[stop:], t[stop:], index[stop:]
        return number[:stop], t[:stop], index[:stop]

    def _of(self, node: tuple[int, int]) -> tuple[Array, Array, Array]:
        table = self._view.table("ESCStatus")
        mine = [rows for unit, rows in units(self._view).items() if (unit.bus, unit.node) == node]
        if table is None or not mine:
            return np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0, np.uint8)
        rows = np.sort(np.concatenate(mine))
        return table["transfer"][rows].astype(np.int64), table.t[rows], table["esc_index"][rows]


def _good(table: DecodedTable | None) -> Array:
    return np.empty(0, np.int64) if table is None else np.flatnonzero(usable(table))
