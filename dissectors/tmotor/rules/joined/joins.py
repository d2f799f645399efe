"""Views of a batch that several rules share: commands by bus, reports by ESC.

Rows are joined by the number of their transfers, which is the order in which transfers ended.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from dissectors.kit import NO_TIME, groups, usable
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from dissectors.kit import Array, DecodedTable, View

MOST_UNITS = 4096  # of bus, node and index that are remembered
NO_CHANNEL = -32768  # no 14-bit number
FULL_THROTTLE = 8191  # 4.4.1
_INDEXES = 32


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


class InForce(NamedTuple):
    """The command in force at each of some rows, 0 for the one before the batch: its place, time and one channel."""

    k: Array
    t: Array
    cmd: Array


_units: WeakKeyDictionary[View, Mapping[ReportingEsc, Array]] = WeakKeyDictionary()
_commands: WeakKeyDictionary[View, Mapping[int, RawCommands]] = WeakKeyDictionary()


def units(view: View) -> Mapping[ReportingEsc, Array]:
    """Return rows of usable ESCStatus by ESC, in order."""
    if view not in _units:
        table = view.table("ESCStatus")
        _units[view] = {} if table is None else dict(_split(table, _rows(view, table)))
    return _units[view]


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
        return in_force(commands(view).get(bus), (t, before), index, table, rows)


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


def _split(table: DecodedTable, rows: Array) -> Iterator[tuple[ReportingEsc, Array]]:
    bus, src = table.bus[rows].astype(np.uint32), table.src[rows].astype(np.uint32)
    code = (bus << 7 | src) << 5 | table["esc_index"][rows]
    for number, places in groups(code):
        yield ReportingEsc(number >> 12, number >> 5 & 0x7F, number & _INDEXES - 1), rows[places]


def _throttles(view: View, table: DecodedTable, rows: Array) -> Iterator[tuple[int, RawCommands]]:
    offsets, values = table.lists("cmd")
    counts = np.diff(offsets)
    buses = table.bus[rows]
    for bus in np.flatnonzero(np.bincount(buses)).tolist():
        mine = rows[buses == bus]
        count = counts[mine]
        most = int(count.max())
        places = offsets[mine][None, :] + np.arange(most)[:, None]
        if int(count.min()) == most:
            cmd = values[places] if most else np.empty((0, len(mine)), np.int16)
        else:
            inside = np.arange(most)[:, None] < count
            cmd = np.where(inside, values[np.where(inside, places, 0)], NO_CHANNEL).astype(np.int16)
        number = table["transfer"][mine].astype(np.int64)
        ended = np.zeros(len(view.transfers), np.int64)
        after = table.row[mine] + 1
        ended[after[after < len(ended)]] = 1
        yield bus, RawCommands(table, mine, np.cumsum(ended), number, table.t[mine], table.src[mine], count, cmd)
