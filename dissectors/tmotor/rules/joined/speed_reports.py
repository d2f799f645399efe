"""The reports of each ESC about its motor: in ESCStatus, or in the status packet 0x15 if it sends no other."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dissectors.kit import NO_TIME, by_key, sound
from dissectors.tmotor.rules.joined.joins import FirstReports, ReportingEsc, esc_reports
from dissectors.tmotor.rules.packets.carried import FIRST_UNIT, unit_key

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

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


class PacketGroup(NamedTuple):
    """Status packets of one node and unit: where they are in a batch's, and the index of the ESC that they speak of.

    They are `alone` up to the first ESCStatus of the node: the index is that of the unit then.
    """

    bus: int
    node: int
    unit: int
    index: int  # type: ignore[assignment]  # hides a method of tuples that nobody asks for
    alone: bool
    part: slice

    @property
    def esc(self) -> ReportingEsc:
        """The ESC."""
        return ReportingEsc(self.bus, self.node, self.index)


class PacketRows(NamedTuple):
    """Sound status packets of a batch whose ESCs are known, one group after the other; those of each are in order."""

    table: DecodedTable
    rows: Array
    number: Array
    groups: Sequence[PacketGroup]

    def each(self, values: Sequence[int]) -> Array:
        """Return for each packet what is said of its group."""
        return np.repeat(np.array(values, np.int64), [group.part.stop - group.part.start for group in self.groups])


def _by_unit(table: DecodedTable) -> tuple[Array, Array, list[tuple[int, int, int, int, int]]]:
    """Return sound status packets with a time: rows and transfers, one unit after the other; several rules ask.

    Of each unit there is its bus, node and number, where its packets begin, and where they end.
    """
    rows = (sound(table) & (table.t != NO_TIME)).nonzero()[0]
    order, begins = by_key(unit_key(table)[rows])
    rows = rows[order]
    first = rows[begins]
    columns = table.bus[first], table.src[first], table["unit_id"][first], begins, np.append(begins, len(rows))[1:]
    units = list(zip(*(column.tolist() for column in columns), strict=True))
    return rows, table["transfer"][rows].astype(np.int64), units


class StatusPackets:
    """Tells which ESC each status packet speaks of."""

    def __init__(self) -> None:
        self._first = FirstReports()

    def feed(self, view: View) -> None:
        """Add a batch before its packets are asked for."""
        self._first.feed(view)

    def of(self, view: View) -> PacketRows | None:
        """Return the status packets in the batch that was fed last, by bus, node and unit."""
        table = view.table("PUSHCAN.MotorStatus")
        if table is None:
            return None
        rows, number, units = table.once(_by_unit)
        groups: list[PacketGroup] = []
        pieces: list[slice] = []
        for bus, node, unit, begin, end in units:
            first, index = self._first.of(bus, node) or (1 << 62, 0)
            middle = begin + int(np.searchsorted(number[begin:end], first))
            for start, stop, alone, which in (
                (begin, middle, True, unit - FIRST_UNIT), (middle, end, False, index)
            ):  # fmt: skip
                if start < stop and 0 <= which <= _LAST_INDEX:
                    done = groups[-1].part.stop if groups else 0
                    part = slice(done, done + stop - start)
                    groups.append(PacketGroup(bus, node, unit, which, alone, part))
                    pieces.append(slice(start, stop))
        if not groups:
            return None
        if groups[-1].part.stop < len(rows):
            rows, number = (np.concatenate([column[piece] for piece in pieces]) for column in (rows, number))
        return PacketRows(table, rows, number, groups)


class SpeedReporters:
    """Tells who reports in which way."""

    def __init__(self) -> None:
        self._packets = StatusPackets()

    def feed(self, view: View) -> PacketRows | None:
        """Add the next batch; return the status packets of each bus, node and unit."""
        self._packets.feed(view)
        return self._packets.of(view)

    def alone(self, packets: PacketRows | None) -> Iterator[tuple[ReportingEsc, SpeedReports]]:
        """Yield the reports in order of each ESC that had sent no ESCStatus yet."""
        for group in () if packets is None else packets.groups:
            if group.alone and packets is not None:
                status, rows = packets.table, packets.rows[group.part]
                yield group.esc, SpeedReports(
                    status, rows, packets.number[group.part], status.t[rows], status["speed"][rows].astype(np.int64),
                    status["throttle"][rows], status["current"][rows], np.full(len(rows), _NO_MODE),
                    status["fault"][rows] & _THROTTLE_LOSS != 0,
                )  # fmt: skip

    def by_status(self, view: View) -> Iterator[tuple[ReportingEsc, SpeedReports]]:
        """Yield the reports in order of each ESC that sends ESCStatus; packets come before its first one."""
        reports = esc_reports(view)
        if reports is None:
            return
        columns = (
            reports.rows, reports.number, reports.t, reports.column("rpm").astype(np.int64),
            reports.column("power_rating_pct").astype(np.float64), reports.column("current"),
            reports.column("error_count.mode"), reports.column("error_count") & _THROTTLE_LOSS != 0,
        )  # fmt: skip
        for esc, part in zip(reports.escs, reports.parts, strict=True):
            yield esc, SpeedReports(reports.table, *(column[part] for column in columns))
