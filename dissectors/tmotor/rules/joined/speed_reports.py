"""The reports of each ESC about its motor: in ESCStatus, or in the status packet 0x15 if it sends no other."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dissectors.kit import NO_TIME, sound
from dissectors.tmotor.rules.joined.joins import FirstReports, ReportingEsc, units
from dissectors.tmotor.rules.packets.carried import FIRST_UNIT, by_unit

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


class StatusPackets:
    """Tells which ESC each status packet speaks of."""

    def __init__(self) -> None:
        self._first = FirstReports()

    def feed(self, view: View) -> None:
        """Add a batch before its packets are asked for."""
        self._first.feed(view)

    def of(self, view: View) -> Iterator[tuple[tuple[int, int], PacketRows]]:
        """Yield the status packets of each bus, node and unit in the batch that was fed last."""
        table = view.table("PUSHCAN.MotorStatus")
        if table is None:
            return
        rows = np.flatnonzero(sound(table) & (table.t != NO_TIME))
        for (bus, node, unit), mine in by_unit(table, rows):
            number = table["transfer"][mine].astype(np.int64)
            first, index = self._first.of(bus, node) or (1 << 62, 0)
            for part, alone, which in ((number < first, True, unit - FIRST_UNIT), (number > first, False, index)):
                if part.any() and 0 <= which <= _LAST_INDEX:
                    yield (bus, node), PacketRows(table, mine[part], number[part], which, alone)


class SpeedReporters:
    """Tells who reports in which way."""

    def __init__(self) -> None:
        self._packets = StatusPackets()

    def feed(self, view: View) -> Iterator[tuple[ReportingEsc, SpeedReports]]:
        """Yield the reports of each ESC in the next batch, in order: packets come before its first ESCStatus."""
        self._packets.feed(view)
        table = view.table("ESCStatus")
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
        return self._packets.of(view)
