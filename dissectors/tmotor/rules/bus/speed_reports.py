"""The reports of each ESC about its motor: in ESCStatus, or in the status packet 0x15 if it sends no other."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dissectors.kit import NO_TIME, sound
from dissectors.tmotor.rules.bus.joins import MOST_UNITS, ReportingEsc, units
from dissectors.tmotor.rules.packets.carried import FIRST_UNIT

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, DecodedTable, View

_LAST_INDEX = 31
_NO_MODE = 0
_THROTTLE_LOSS = 1 << 3


class SpeedReports(NamedTuple):
    """Reports of one ESC in order, `rows` of a table: transfer number, time, rpm, throttle in %, A, operating mode.

    `lost` marks those with the flag of throttle loss.
    """

    table: DecodedTable
    rows: Array
    number: Array
    t: Array
    rpm: Array
    pct: Array
    current: Array
    mode: Array
    lost: Array


class PacketRows(NamedTuple):
    """Sound status packets of one node and unit, and the index of the ESC that they speak of.

    They are `alone` up to the first ESCStatus of the node: the index is that of the unit then.
    """

    table: DecodedTable
    rows: Array
    number: Array
    esc_index: int
    alone: bool


class SpeedReporters:
    """Tells who reports in which way; the first `MOST_UNITS` nodes count."""

    def __init__(self) -> None:
        self._first: dict[tuple[int, int], tuple[int, int]] = {}  # ESCStatus of a node: transfer number, index

    def feed(self, view: View) -> Iterator[tuple[ReportingEsc, SpeedReports]]:
        """Yield the reports of each ESC in the next batch, in order: packets come before its first ESCStatus."""
        table = view.table("ESCStatus")
        for unit, rows in units(view).items():
            sender = unit.bus, unit.node
            if table is not None and (sender in self._first or len(self._first) < MOST_UNITS):
                first = int(table["transfer"][rows[0]]), unit.index
                self._first[sender] = min(self._first.get(sender, first), first)
        for (bus, node), packets in self.packets(view):
            if packets.alone:
                status, rows = packets.table, packets.rows
                yield ReportingEsc(bus, node, packets.esc_index), SpeedReports(
                    status, rows, packets.number, status.t[rows], status["speed"][rows].astype(np.int64),
                    status["throttle"][rows], status["current"][rows], np.full(len(rows), _NO_MODE),
                    status["fault"][rows] & _THROTTLE_LOSS != 0,
                )  # fmt: skip
        for unit, rows in units(view).items():
            if table is not None:
                yield unit, SpeedReports(
                    table, rows, table["transfer"][rows].astype(np.int64), table.t[rows],
                    table["rpm"][rows].astype(np.int64), table["power_rating_pct"][rows].astype(np.float64),
                    table["current"][rows], table["error_count.mode"][rows],
                    table["error_count"][rows] & _THROTTLE_LOSS != 0,
                )  # fmt: skip

    def packets(self, view: View) -> Iterator[tuple[tuple[int, int], PacketRows]]:
        """Yield the status packets of each bus, node and unit."""
        table = view.table("PUSHCAN.MotorStatus")
        if table is None:
            return
        rows = np.flatnonzero(sound(table) & (table.t != NO_TIME))
        code = (table.bus[rows].astype(np.int64) << 16) | (table.src[rows].astype(np.int64) << 8)
        code |= table["unit_id"][rows]
        for one in np.unique(code).tolist():
            bus, node, unit = one >> 16, one >> 8 & 0xFF, one & 0xFF
            mine = rows[code == one]
            number = table["transfer"][mine].astype(np.int64)
            first, index = self._first.get((bus, node), (1 << 62, 0))
            for part, alone, which in ((number < first, True, unit - FIRST_UNIT), (number > first, False, index)):
                if part.any() and 0 <= which <= _LAST_INDEX:
                    yield (bus, node), PacketRows(table, mine[part], number[part], which, alone)
