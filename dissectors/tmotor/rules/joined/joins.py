"""Views of a batch that several rules share: commands by bus, reports by ESC.

Rows are joined by the number of their transfers, which is the order in which transfers ended.
"""

from __future__ import annotations

from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from dissectors.kit import NO_TIME, by_key, frames_of, usable
from dissectors.kit.order import spans
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from dissectors.kit import Array, DecodedTable, View

MOST_UNITS = 4096  # of bus, node and index that are remembered
NO_CHANNEL = -32768  # no 14-bit number
FULL_THROTTLE = 8191  # 4.4.1
_INDEXES = 32
Evidence = tuple[tuple[int, ...], tuple[str, ...]]  # numbers of frames, and how candump writes them


class ReportingEsc(NamedTuple):
    """An ESC as its reports name it."""

    bus: int
    node: int
    index: int  # type: ignore[assignment]  # hides a method of tuples that nobody asks for


@dataclass(frozen=True, slots=True, eq=False)
class RawCommands:
    """RawCommand of one bus in a batch; `cmd` has a row for each channel, `NO_CHANNEL` where a command is shorter.

    `ended` are how many of them ended before each transfer of the batch.
    """

    table: DecodedTable
    rows: Array
    ended: Array
    number: Array
    t: Array
    src: Array
    counts: Array
    cmd: Array

    def before(self, table: DecodedTable, rows: Array) -> Array:
        """Return how many of them ended before each row of another table."""
        found: Array = self.ended[table.row[rows]]
        return found

    def channel(self, index: int) -> Array:
        """Return the throttle of a channel in each, `NO_CHANNEL` where it is too short."""
        if index < len(self.cmd):
            found: Array = self.cmd[index]
            return found
        return np.full(len(self.t), NO_CHANNEL, np.int16)

    def paused(self, last: int, longest: int) -> Array:
        """Return those that came later than so many ns after the one before; `last` is the time before all of them."""
        first = last == NO_TIME or bool(self.t[0] - last > longest)
        return np.concatenate((np.array([first]), np.diff(self.t) > longest))


class EscReports:
    """Usable ESCStatus of a batch, one ESC after the other, those of each in order.

    `rows` are those of the table, `first` is where the ones of each ESC begin, and where the last ones end; `of` says
    which ESC each is of.
    """

    def __init__(self, table: DecodedTable, escs: Sequence[ReportingEsc], rows: Array, first: Array) -> None:
        self.table, self.escs, self.rows, self.first = table, escs, rows, first
        self.of = np.repeat(np.arange(len(escs)), first[1:] - first[:-1])
        self.parts = [slice(*ends) for ends in pairwise(first.tolist())]
        self._columns: dict[str, Array] = {}

    def column(self, name: str) -> Array:
        """Return a column of the table at these rows, and keep it."""
        if name not in self._columns:
            self._columns[name] = self.table[name][self.rows]
        return self._columns[name]

    @property
    def t(self) -> Array:
        """Times."""
        return self.column("t")

    @cached_property
    def number(self) -> Array:
        """Numbers of transfers."""
        return self.column("transfer").astype(np.int64)

    def before(self, values: Array, first: Sequence[Any]) -> Array:
        """Return the value in front of each among its ESC's; in front of all of an ESC is the one given for it."""
        found = np.empty_like(values)
        found[1:] = values[:-1]
        found[self.first[:-1]] = first
        return found

    def any(self, mask: Array) -> list[bool]:
        """Return of each ESC whether the mask is set somewhere."""
        found: list[bool] = np.logical_or.reduceat(mask, self.first[:-1]).tolist()
        return found

    def by_bus(self) -> Iterator[tuple[int, slice]]:
        """Yield each bus, and where its reports are."""
        buses = np.array([esc.bus for esc in self.escs])
        for bus, begin, end in spans(buses):
            yield bus, slice(self.first.item(begin), self.first.item(end))


class InForce(NamedTuple):
    """The command in force at each of some rows, 0 for the one before the batch: its place, time and one channel."""

    k: Array
    t: Array
    cmd: Array


_reports: WeakKeyDictionary[View, EscReports | None] = WeakKeyDictionary()
_units: WeakKeyDictionary[View, Mapping[ReportingEsc, Array]] = WeakKeyDictionary()
_last_reports: WeakKeyDictionary[View, Mapping[ReportingEsc, Evidence]] = WeakKeyDictionary()
_commands: WeakKeyDictionary[View, Mapping[int, RawCommands]] = WeakKeyDictionary()
# What was in force at rows, which are kept with it, so that their number stays their own.
_forced: WeakKeyDictionary[View, dict[tuple[object, ...], tuple[Array, InForce]]] = WeakKeyDictionary()
_at_reports: WeakKeyDictionary[View, dict[tuple[object, ...], InForce]] = WeakKeyDictionary()


def esc_reports(view: View) -> EscReports | None:
    """Return usable ESCStatus, None if there are none."""
    if view not in _reports:
        table = view.table("ESCStatus")
        _reports[view] = None if table is None else _split(table, _rows(view, table))
    return _reports[view]


def units(view: View) -> Mapping[ReportingEsc, Array]:
    """Return rows of usable ESCStatus by ESC, in order."""
    if view not in _units:
        some = esc_reports(view)
        parts = () if some is None else zip(some.escs, some.parts, strict=True)
        _units[view] = {} if some is None else {esc: some.rows[part] for esc, part in parts}
    return _units[view]


def last_reports(view: View) -> Mapping[ReportingEsc, Evidence]:
    """Return the frames of the last usable ESCStatus of each ESC, with their lines; several rules keep them."""
    if view not in _last_reports:
        reports = esc_reports(view)
        last = [] if reports is None else reports.rows[reports.first[1:] - 1].tolist()
        escs = () if reports is None else zip(reports.escs, last, strict=True)
        _last_reports[view] = {esc: evidence(view, reports.table, row) for esc, row in escs if reports is not None}
    return _last_reports[view]


def evidence(view: View, table: DecodedTable, row: int) -> Evidence:
    """Return the frames of a row, with their lines."""
    frames = frames_of(view, table, row)
    return frames, view.lines(frames)


def commands(view: View) -> Mapping[int, RawCommands]:
    """Return usable RawCommand by bus, in order."""
    if view not in _commands:
        table = view.table("RawCommand")
        _commands[view] = {} if table is None else dict(_throttles(view, table, _rows(view, table)))
    return _commands[view]


def in_force(
    sent: RawCommands | None, before: tuple[int, int], index: int, table: DecodedTable, rows: Array
) -> InForce:
    """Return the command in force at each row of another table.

    Args:
        sent: those of the bus in this batch.
        before: time and throttle of the last one before.
        index: the channel.
        table: has the rows.
        rows: in order.
    """
    k = np.zeros(len(rows), np.int64)
    if sent is None:
        return InForce(k, np.full(len(rows), before[0]), np.full(len(rows), before[1], np.int64))
    k = sent.before(table, rows)
    return InForce(k, last_of(sent.t, k, before[0]), last_of(sent.channel(index), k, before[1]))


def last_of(values: Array, count: Array, before: int) -> Array:
    """Return the last one of so many first values, `before` where these are none."""
    if not len(values):
        return np.full(len(count), before, np.int64)
    found: Array = values[np.maximum(count, 1) - 1].astype(np.int64)
    found[count == 0] = before
    return found


def fresh(t: Array, since: Array, longest: int) -> Array:
    """Return which times are at most so many ns behind others, where those are known."""
    found: Array = (since != NO_TIME) & (t - np.maximum(since, 0) <= longest)
    return found


def in_order(*parts: tuple[DecodedTable | None, Iterable[int]]) -> list[tuple[DecodedTable, int]]:
    """Return rows of several tables one by one, in the order of their transfers; of equal ones the first table goes."""
    rows = [(table, row) for table, some in parts if table is not None for row in some]
    return sorted(rows, key=lambda one: int(one[0]["transfer"][one[1]]))


def end(view: View, table: DecodedTable, rows: Array) -> Array:
    """Return times of the last frames of rows."""
    return view.transfers.t_end[table.row[rows]]


class LastCommands:
    """The last command of each bus before a batch."""

    def __init__(self) -> None:
        self._last: dict[int, tuple[int, Array]] = {}  # time and channels

    def feed(self, view: View) -> None:
        """Make the commands of a batch, once it has been looked at, those before the next one."""
        for bus, sent in commands(view).items():
            self._last[bus] = int(sent.t[-1]), sent.cmd[:, -1].copy()

    def in_force(self, view: View, bus: int, index: int, table: DecodedTable, rows: Array) -> InForce:
        """Return the command in force at each row; an ESC without a channel has `NO_CHANNEL`."""
        t, channels = self._last.get(bus, (NO_TIME, np.empty(0, np.int16)))
        before = int(channels[index]) if index < len(channels) else NO_CHANNEL
        if len(rows) == 1:
            return in_force(commands(view).get(bus), (t, before), index, table, rows)
        known, key = _forced.setdefault(view, {}), (bus, t, before, index, table, id(rows))
        if key not in known:
            known[key] = rows, in_force(commands(view).get(bus), (t, before), index, table, rows)
        return known[key][1]

    def at_reports(self, view: View, reports: EscReports) -> InForce:
        """Return the command in force at each report, of the ESC's channel; several rules ask."""
        key = tuple((bus, t, channels.tobytes()) for bus, (t, channels) in self._last.items())
        known = _at_reports.setdefault(view, {})
        if key not in known:
            known[key] = self._at_reports(view, reports)
        return known[key]

    def _at_reports(self, view: View, reports: EscReports) -> InForce:
        bus = np.repeat([esc.bus for esc in reports.escs], reports.first[1:] - reports.first[:-1])
        return self.at_rows(view, reports.table, reports.rows, bus, reports.column("esc_index") & _INDEXES - 1)

    def at_rows(self, view: View, table: DecodedTable, rows: Array, bus: Array, index: Array) -> InForce:
        """Return the command in force at rows of a table, of a channel each; rows stand together by bus."""
        found = InForce(*np.zeros((3, len(rows)), np.int64))
        for one, *ends in spans(bus):
            part = slice(*ends)
            channel, sent = index[part], commands(view).get(one)
            t, channels = self._last.get(one, (NO_TIME, np.empty(0, np.int16)))
            last = np.append(channels, np.full(max(_INDEXES - len(channels), 0), NO_CHANNEL, np.int16))[channel]
            if sent is None:
                found.t[part], found.cmd[part] = t, last
                continue
            k = found.k[part] = sent.before(table, rows[part])
            found.t[part] = last_of(sent.t, k, t)
            cmd = (
                sent.cmd[np.minimum(channel, len(sent.cmd) - 1), np.maximum(k, 1) - 1] if len(sent.cmd) else NO_CHANNEL
            )
            found.cmd[part] = np.where(k == 0, last, np.where(channel < len(sent.cmd), cmd, NO_CHANNEL))
        return found


class FirstReports:
    """The first ESCStatus of each node: its transfer and index. The first `MOST_UNITS` nodes count."""

    def __init__(self) -> None:
        self._first: dict[tuple[int, int], tuple[int, int]] = {}

    def feed(self, view: View) -> None:
        """Add a batch."""
        table = view.table("ESCStatus")
        for unit, rows in units(view).items():
            node = unit.bus, unit.node
            if table is not None and (node in self._first or len(self._first) < MOST_UNITS):
                first = int(table["transfer"][rows[0]]), unit.index
                self._first[node] = min(self._first.get(node, first), first)

    def of(self, bus: int, node: int) -> tuple[int, int] | None:
        """Return transfer and index of a node's first report, None if it sends none."""
        return self._first.get((bus, node))


def _rows(view: View, table: DecodedTable) -> Array:
    """Return rows to look at; without the few that have no time in a capture with times."""
    good = usable(table)
    if view.start != NO_TIME:
        good = good & (table.t != NO_TIME)
    return np.flatnonzero(good)


def _split(table: DecodedTable, rows: Array) -> EscReports | None:
    if not len(rows):
        return None
    bus, src = table.bus[rows].astype(np.uint32), table.src[rows].astype(np.uint32)
    code = (bus << 7 | src) << 5 | table["esc_index"][rows]
    order, first = by_key(code)
    keys = code[order[first]].tolist()
    escs = [ReportingEsc(number >> 12, number >> 5 & 0x7F, number & _INDEXES - 1) for number in keys]
    return EscReports(table, escs, rows[order], np.append(first, len(rows)))


def _throttles(view: View, table: DecodedTable, rows: Array) -> Iterator[tuple[int, RawCommands]]:
    offsets, values = table.lists("cmd")
    counts = np.diff(offsets)
    buses = table.bus[rows]
    for bus in np.flatnonzero(np.bincount(buses)).tolist():
        mine = rows[buses == bus]
        count = counts[mine]
        most, begin, behind = int(count.max()), int(mine[0]), int(mine[-1]) + 1
        if int(count.min()) == most and behind - begin == len(mine):  # mostly all are equally long
            block = values[offsets[begin] : offsets[behind]].reshape(len(mine), most)
            cmd = np.ascontiguousarray(block.T, np.int16)
        else:
            places = offsets[mine][None, :] + np.arange(most)[:, None]
            inside = np.arange(most)[:, None] < count
            cmd = np.where(inside, values[np.where(inside, places, 0)], NO_CHANNEL).astype(np.int16)
        number = table["transfer"][mine].astype(np.int64)
        ended = np.zeros(len(view.transfers), np.int64)
        after = table.row[mine] + 1
        ended[after[after < len(ended)]] = 1
        yield bus, RawCommands(table, mine, np.cumsum(ended), number, table.t[mine], table.src[mine], count, cmd)
