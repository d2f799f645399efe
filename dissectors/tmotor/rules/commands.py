"""Throttle commands, and what holds for transfers of all T-Motor's types: priority, length prefix, FocCtrl."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from dissectors.conformance import NO_TIME, SECOND, Watcher, watches
from dissectors.tmotor.rules.rows import usable

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.conformance import Found, Table, Values, View, Words

_LOWEST = 31
_COMMANDS = (1030, 1033, 1038)
_ESC_STATUS = 1034
_REPORTS = (1039, 1332)  # only a node with the T-Motor dialect sends them
_FOC_CTRL = 1035
_MESSAGES = (0, 1)  # kinds, anonymous ones too
_WHOLE_BYTE = 2  # layout code; 1 is the prefix of the DSDL
_INDEXES = 32  # esc_index has 5 bits
# Arrays at the end of types, by the bits of the length that the DSDL gives them.
_TAILS = {"RawCommand": ("cmd", 5), "PUSHSCI": ("data", 8), "PUSHCAN": ("data", 8), "ParamGet": ("rsvd", 6)}


@watches("CAN-013")
def priorities(view: View) -> Iterator[Found]:
    """Document types with another priority than 31 (4.3.1)."""
    transfers = view.transfers
    rows = np.flatnonzero(transfers.priority != _LOWEST)
    rows = rows[np.isin(transfers.kind[rows], _MESSAGES)]
    types = transfers.type_id[rows]

    def found(mine: Words, **about: Any) -> Found:
        key = transfers.priority[mine]
        return view.among_transfers(
            "CAN-013", mine, lambda row: {"priority": int(transfers.priority[row])}, key=key, **about
        )

    for chosen, about in (
        (_COMMANDS, {}),
        ((_ESC_STATUS,), {"dialects": {"tm": "warning"}}),
        (_REPORTS, {"severity": "warning", "dialects": {"dronecan": "note"}}),
    ):
        mine = rows[np.isin(types, chosen)]
        if mine.size:
            yield found(mine, **about)


@watches("CAN-016")
def foc_ctrl(view: View) -> Iterator[Found]:
    """Type 1035, which V2.2 no longer has (6)."""
    transfers = view.transfers
    rows = np.flatnonzero(transfers.type_id == _FOC_CTRL)
    rows = rows[np.isin(transfers.kind[rows], _MESSAGES)]
    if rows.size:
        yield view.among_transfers("CAN-016", rows, lambda _row: {})


@watches("TYP-006")
def prefixes(view: View) -> Iterator[Found]:
    """Array lengths that classic CAN leaves out (5.3)."""
    for name, (field, width) in _TAILS.items():
        table = view.table(name)
        if table is None or not table["layout"].any():
            continue
        mine = np.flatnonzero((table["layout"] != 0) & usable(table))
        mine = mine[~view.transfers.fd[table.row[mine]]]
        if mine.size:
            yield _prefixed(view, table, mine, field, width)


def _prefixed(view: View, table: Table, rows: Words, field: str, width: int) -> Found:
    layout, (starts, _) = table["layout"], table.lists(field)

    def values(row: int) -> Values:
        whole = layout[row] == _WHOLE_BYTE or width == 8
        form = "whole-byte" if whole else f"{width}-bit"
        return {"form": form, "prefix": int(starts[row + 1] - starts[row])}

    return view.among_rows("TYP-006", table, rows, values, key=layout[rows])


@watches("TYP-101", "TYP-102")
def ranges(view: View) -> Iterator[Found]:
    """Channels below 0, and below -8191 (4.4.1 expl. 2)."""
    table = view.table("RawCommand")
    if table is None:
        return
    starts, values = table.lists("cmd")
    low = np.flatnonzero(values < 0)
    if not low.size:
        return
    rows = np.searchsorted(starts, low, "right") - 1
    good = usable(table)[rows]
    low, rows = low[good], rows[good]
    for rule, limit in (("TYP-101", 0), ("TYP-102", -8191)):
        mine = values[low] < limit
        if mine.any():
            yield _channels(view, rule, table, rows[mine], low[mine])


def _channels(view: View, rule: str, table: Table, rows: Words, at: Words) -> Found:
    """Elements `at` of the lists of `rows`; a row may be there more than once."""
    starts, values = table.lists("cmd")
    channels = at - starts[rows] + 1

    def told(k: int) -> Values:
        return {"channel": int(channels[k]), "value": int(values[at[k]])}

    return replace(view.among_rows(rule, table, rows, lambda _row: {}, key=channels), values=told)


class Counts(Watcher):
    """Channels against the indexes that ESCs reported in the time before (4.4.1 expl. 3).

    Nothing is said until that time has passed since the first report on a bus: until then ESCs may be missing.
    """

    rules = ("TYP-103",)

    def __init__(self) -> None:
        self._last = np.full((256, _INDEXES), NO_TIME)  # by bus and index
        self._first = np.full(256, NO_TIME)

    def look(self, view: View) -> Iterator[Found]:
        """Commands of this batch; a report counts for those that ended after it."""
        window = round(view.number("TYP-103", "window_s") * SECOND)
        commands, reports = view.table("RawCommand"), view.table("ESCStatus")
        asked = np.empty(0, np.int64) if commands is None else np.flatnonzero(usable(commands) & _timed(commands))
        told = np.empty(0, np.int64) if reports is None else np.flatnonzero(usable(reports) & _timed(reports))
        for bus in range(len(view.buses)):
            mine = asked if commands is None else asked[commands.bus[asked] == bus]
            heard = told if reports is None else told[reports.bus[told] == bus]
            wrong, highest = self._judge(bus, commands, mine, reports, heard, window)
            if commands is not None and wrong.size:
                yield _miscounted(view, commands, wrong, highest)

    def _judge(
        self, bus: int, commands: Table | None, mine: Words, reports: Table | None, heard: Words, window: int
    ) -> tuple[Words, Words]:
        """Rows of commands with a wrong number of channels, and the highest index at each; notes the reports."""
        highest = np.full(len(mine), -1)
        settled = np.zeros(len(mine), bool)
        number = t = at = indexes = np.empty(0, np.int64)
        if commands is not None:
            number, t = commands["transfer"][mine], commands.t[mine]
        if reports is not None and heard.size:
            at, indexes = reports.t[heard], reports["esc_index"][heard]
            if self._first[bus] == NO_TIME:
                self._first[bus] = at[0]
        if self._first[bus] != NO_TIME:
            settled = t - self._first[bus] >= window
        spoken = np.bincount(indexes, minlength=_INDEXES)
        for index in np.flatnonzero((spoken > 0) | (self._last[bus] != NO_TIME))[::-1].tolist():
            latest = last = self._last[bus, index]
            todo = np.flatnonzero(highest < 0)
            if reports is not None and spoken[index]:
                here = indexes == index
                times = np.append(last, at[here])
                self._last[bus, index] = times[-1]
                latest = times[np.searchsorted(reports["transfer"][heard[here]], number[todo])]
            live = (latest != NO_TIME) & (t[todo] - latest <= window)
            highest[todo[live]] = index
        if commands is None:
            return mine, highest
        starts, _ = commands.lists("cmd")
        wrong = settled & (highest >= 0) & (np.diff(starts)[mine] != highest + 1)
        return mine[wrong], highest[wrong]


def _timed(table: Table) -> Words:
    timed: Words = table.t != NO_TIME
    return timed


def _miscounted(view: View, commands: Table, rows: Words, highest: Words) -> Found:
    starts, _ = commands.lists("cmd")
    channels = np.diff(starts)
    found = view.among_rows("TYP-103", commands, rows, lambda _row: {}, key=channels[rows])
    return replace(found, values=lambda k: {"channels": int(channels[rows[k]]), "highest_index": int(highest[k])})


@watches("TYP-104")
def empty(view: View) -> Iterator[Found]:
    """Commands without a byte (4.4.1)."""
    table = view.table("RawCommand")
    if table is None:
        return
    starts, _ = table.lists("cmd")
    rows = np.flatnonzero(np.diff(starts) == 0)
    if rows.size:
        rows = rows[usable(table)[rows] & (view.transfers.length[table.row[rows]] == 0)]
        yield view.among_rows("TYP-104", table, rows, lambda _row: {})


@watches("TYP-105")
def words(view: View) -> Iterator[Found]:
    """One value as low byte, high byte and five zeros, where four channels of 14 bits belong (4.4.1, example).

    The low two bits of the high byte come out as 64 times as much in the second channel.
    """
    table = view.table("RawCommand")
    if table is None:
        return
    starts, values = table.lists("cmd")
    rows = np.flatnonzero(np.diff(starts) == 4)
    at = starts[rows]
    rows = rows[(values[at + 3] == 0) & (values[at + 2] == 0) & np.isin(values[at + 1], (64, 128, 192))]
    if not rows.size:
        return
    first = values[starts[rows]]
    exact = (first >= 0) & (first < 1 << 12) & (table["layout"][rows] == 0) & (table["bits_left"][rows] == 0)
    single = ~view.transfers.has("crc_wire")[table.row[rows]]
    rows = rows[exact & single & table.trusted[rows]]

    def told(row: int) -> Values:
        one, two = (int(value) for value in values[starts[row] : starts[row] + 2])
        return {"word": one & 0xFF | (one >> 8 << 2 | two >> 6) << 8, "first": one, "second": two}

    yield view.among_rows("TYP-105", table, rows, told)


WATCHERS: tuple[type[Watcher], ...] = (priorities, foc_ctrl, prefixes, ranges, Counts, empty, words)
