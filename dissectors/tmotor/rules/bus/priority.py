"""CAN throttle for ESCs that say they take PWM first (4.2, 4.4.2 no 21)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import NO_TIME, Rule, breach, sound, usable
from dissectors.tmotor.rules.bus.joins import MOST_UNITS, commands, units

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, DecodedTable, Occurrence, View

_PWM, _CAN = 0, 1
# Messages that tell the throttle priority of their sender, and the column.
_TELL = (("ParamGet", "esc_signal_priority"), ("PUSHCAN.FocFeedback", "throttle_priority"))


@dataclass(slots=True)
class _Esc:
    """The last words of a node: its priority, since which transfer, and whether throttle for it was told since."""

    priority: int
    since: int
    told: bool = False


class PwmFirst(Rule):
    """Finds the first throttle above zero for each ESC since it said that PWM comes first."""

    rules = ("BUS-041",)

    def __init__(self) -> None:
        self._escs: dict[tuple[int, int], _Esc] = {}
        self._indexes: dict[tuple[int, int], tuple[int, int]] = {}  # index of the first ESCStatus, and its transfer

    def feed(self, view: View) -> Iterator[Occurrence]:
        """Look at commands between one thing said and the next."""
        self._note(view)
        said = sorted(one for table, column in _tables(view) for one in _said(table, column))
        for transfer, bus, node, priority in said:
            known = self._escs.get((bus, node))
            if known is not None and known.priority == priority:
                continue
            if known is not None:
                yield from self._throttle(view, (bus, node), known, transfer)
            if known is not None or len(self._escs) < MOST_UNITS:
                self._escs[bus, node] = _Esc(priority, transfer)
        for who, esc in self._escs.items():
            yield from self._throttle(view, who, esc, 1 << 62)

    def _note(self, view: View) -> None:
        table, found = view.table("ESCStatus"), dict[tuple[int, int], tuple[int, int]]()
        for unit, rows in units(view).items():
            if table is not None and (unit.bus, unit.node) not in self._indexes:
                first = int(table["transfer"][rows[0]]), unit.index
                found[unit.bus, unit.node] = min(first, found.get((unit.bus, unit.node), first))
        for who, (transfer, index) in found.items():
            if len(self._indexes) < MOST_UNITS:
                self._indexes[who] = index, transfer

    def _throttle(self, view: View, who: tuple[int, int], esc: _Esc, until: int) -> Iterator[Occurrence]:
        sent, (index, first) = commands(view).get(who[0]), self._indexes.get(who, (-1, 0))
        if esc.told or esc.priority != _PWM or sent is None or not 0 <= index < len(sent.cmd):
            return
        since = max(esc.since, first)
        rows = np.flatnonzero((sent.cmd[index] > 0) & (sent.number > since) & (sent.number < until))
        if len(rows):
            esc.told = True
            values = {"channel": index + 1, "esc": who[1], "value": int(sent.cmd[index, rows[0]])}
            yield breach(view, sent.table, int(sent.rows[rows[0]]), "BUS-041", values)


def _tables(view: View) -> Iterator[tuple[DecodedTable, str]]:
    for name, column in _TELL:
        table = view.table(name)
        if table is not None:
            yield table, column


def _said(table: DecodedTable, column: str) -> list[tuple[int, int, int, int]]:
    """Return transfer, bus, node and priority of each message that has one of the two."""
    good = usable(table) if "bits_left" in table else sound(table)
    rows: Array = np.flatnonzero(good & (table[column] <= _CAN) & (table.t != NO_TIME))
    columns = (table["transfer"][rows], table.bus[rows], table.src[rows], table[column][rows])
    return list(zip(*(one.astype(np.int64).tolist() for one in columns), strict=True))
