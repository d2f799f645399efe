"""What several rules need of a batch: commands by bus, reports by ESC, whether motors turn, when a bus was silent.

Rows are joined by the number of their transfers, which is the order in which transfers ended.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from dissectors.conformance import NO_TIME
from dissectors.tmotor.rules.rows import usable

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from dissectors.conformance import Table, View, Words

MOST_UNITS = 4096  # of bus, node and index that are remembered
NO_CHANNEL = -32768  # no 14-bit number
COMMANDS = -1  # in place of a node: the throttle on a bus
_INDEXES = 32


class Unit(NamedTuple):
    """An ESC as its reports name it."""

    bus: int
    node: int
    index: int  # type: ignore[assignment]  # hides a method of tuples that nobody asks for


@dataclass(frozen=True, slots=True, eq=False)
class Commands:
    """RawCommand of one bus in a batch; `cmd` has a row for each channel, `NO_CHANNEL` where a command is shorter."""

    table: Table
    rows: Words
    number: Words
    t: Words
    src: Words
    counts: Words
    cmd: Words

    def before(self, table: Table, rows: Words) -> Words:
        """How many of them ended before each row of another table."""
        return np.searchsorted(self.number, table["transfer"][rows].astype(np.int64))

    def paused(self, last: int, longest: int) -> Words:
        """Those that came later than so many ns after the one before them; `last` is the time of the one before all."""
        first = last == NO_TIME or bool(self.t[0] - last > longest)
        return np.concatenate((np.array([first]), np.diff(self.t) > longest))


_units: WeakKeyDictionary[View, Mapping[Unit, Words]] = WeakKeyDictionary()
_commands: WeakKeyDictionary[View, Mapping[int, Commands]] = WeakKeyDictionary()


def units(view: View) -> Mapping[Unit, Words]:
    """Rows of usable ESCStatus by ESC, in order."""
    if view not in _units:
        table = view.table("ESCStatus")
        _units[view] = {} if table is None else dict(_split(table, _rows(view, table)))
    return _units[view]


def commands(view: View) -> Mapping[int, Commands]:
    """Usable RawCommand by bus, in order."""
    if view not in _commands:
        table = view.table("RawCommand")
        _commands[view] = {} if table is None else dict(_throttles(table, _rows(view, table)))
    return _commands[view]


def end(view: View, table: Table, rows: Words) -> Words:
    """Times of the last frames of rows."""
    return view.transfers.t_end[table.row[rows]]


def _rows(view: View, table: Table) -> Words:
    """Rows to look at; without the few that have no time in a capture with times."""
    good = usable(table)
    if view.start != NO_TIME:
        good = good & (table.t != NO_TIME)
    return np.flatnonzero(good)


def _split(table: Table, rows: Words) -> Iterator[tuple[Unit, Words]]:
    bus, src = table.bus[rows].astype(np.uint32), table.src[rows].astype(np.uint32)
    code = (bus << 7 | src) << 5 | table["esc_index"][rows]
    code = code.astype(np.uint16) if len(code) and code.max() < 1 << 16 else code
    order = np.argsort(code, kind="stable")
    ordered = code[order]
    for part in np.split(order, np.flatnonzero(ordered[1:] != ordered[:-1]) + 1):
        if len(part):
            number = int(code[part[0]])
            yield Unit(number >> 12, number >> 5 & 0x7F, number & _INDEXES - 1), rows[part]


def _throttles(table: Table, rows: Words) -> Iterator[tuple[int, Commands]]:
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
        yield bus, Commands(table, mine, number, table.t[mine], table.src[mine], count, cmd)


class Motion:
    """Follows whether motors turn: a throttle is above 0, or an ESC has a speed. The first `MOST_UNITS` count."""

    def __init__(self) -> None:
        self._on: dict[Unit, bool] = {}
        self._turning: dict[int, int] = {}  # units that are on, by bus

    def known(self, bus: int) -> bool:
        """Whether anything is known of a bus."""
        return bus in self._turning

    def turning(self, bus: int) -> bool:
        """Whether motors turn on a bus by now."""
        return self._turning.get(bus, 0) > 0

    def add(self, view: View) -> dict[int, tuple[Words, Words, Words]]:
        """The next batch's changes by bus: transfer numbers, times and whether motors turn from then on."""
        steps: dict[int, list[tuple[Words, Words, Words]]] = {}
        table = view.table("ESCStatus")
        if table is not None:
            for unit, rows in units(view).items():
                self._note(view, steps, unit, (table, rows), table["rpm"][rows] != 0)
        for bus, sent in commands(view).items():
            on: Words = np.any(sent.cmd > 0, axis=0)
            self._note(view, steps, Unit(bus, COMMANDS, 0), (sent.table, sent.rows), on)
        return {bus: self._changes(bus, parts) for bus, parts in steps.items()}

    def _note(
        self, view: View, steps: dict[int, list[tuple[Words, Words, Words]]], unit: Unit,
        where: tuple[Table, Words], on: Words,
    ) -> None:  # fmt: skip
        if unit not in self._on and len(self._on) >= MOST_UNITS:
            return
        self._turning.setdefault(unit.bus, 0)
        before = self._on.get(unit, False)
        self._on[unit] = bool(on[-1])
        at = np.flatnonzero(on != np.concatenate(([before], on[:-1])))
        if len(at):
            table, rows = where[0], where[1][at]
            step = np.where(on[at], 1, -1)
            number = table["transfer"][rows].astype(np.int64)
            steps.setdefault(unit.bus, []).append((number, end(view, table, rows), step))

    def _changes(self, bus: int, parts: list[tuple[Words, Words, Words]]) -> tuple[Words, Words, Words]:
        number, t, step = (np.concatenate(part) for part in zip(*parts, strict=True))
        order = np.argsort(number, kind="stable")
        count = self._turning[bus] + np.cumsum(step[order])
        on = count > 0
        at = np.flatnonzero(on != np.concatenate(([self._turning[bus] > 0], on[:-1])))
        self._turning[bus] = int(count[-1])
        return number[order][at], t[order][at], on[at]


class Pauses:
    """Times in which a whole bus was silent, and when it was heard last.

    Args:
        least: shorter ones, in nanoseconds, do not count. The last 1024 of a bus are kept.
    """

    def __init__(self, least: int) -> None:
        self._least = least
        self.last: dict[int, int] = {}
        self._known: dict[int, list[tuple[int, int]]] = {}

    def add(self, view: View) -> None:
        """The next batch."""
        frames = view.frames
        for bus, rows in rows_by_bus(frames.bus, frames.t):
            t = frames.t if rows is None else frames.t[rows]
            coarse = np.append(t[::64], t[-1])
            self._between(bus, self.last.get(bus, int(t[0])), int(t[0]))
            for k in np.flatnonzero((np.diff(coarse) > self._least) | (np.diff(coarse) < 0)).tolist():
                part = t[k * 64 : k * 64 + 65]
                for at in np.flatnonzero(np.diff(part) > self._least).tolist():
                    self._between(bus, int(part[at]), int(part[at + 1]))
            self.last[bus] = int(t[-1])

    def first(self, bus: int, start: int, stop: int) -> int:
        """When the first silence between two times begins, else the second time."""
        return min((max(start, a) for a, b in self._known.get(bus, ()) if a < stop and b > start), default=stop)

    def inside(self, bus: int, start: int, stop: int) -> int:
        """Nanoseconds of silence between two times."""
        parts = (min(stop, b) - max(start, a) for a, b in self._known.get(bus, ()))
        return sum(part for part in parts if part > 0)

    def _between(self, bus: int, start: int, stop: int) -> None:
        if stop - start > self._least:
            known = self._known.setdefault(bus, [])
            known.append((start, stop))
            del known[:-1024]


def rows_by_bus(bus: Words, t: Words) -> Iterator[tuple[int, Words | None]]:
    """Rows that have a time by bus, None for all."""
    if not len(bus):
        return
    if int(bus.min()) == int(bus.max()) and int(t.min()) != NO_TIME:
        yield int(bus[0]), None
        return
    timed = t != NO_TIME
    for index in np.flatnonzero(np.bincount(bus)).tolist():
        rows = np.flatnonzero((bus == index) & timed)
        if len(rows):
            yield index, rows


class Periods:
    """A histogram of positive times in ns: bins of 0.1 % width, from 1 us to more than a minute."""

    _LOW = int(np.float32(1e3).view(np.int32)) >> 13
    _HIGH = int(np.float32(1e11).view(np.int32)) >> 13

    def __init__(self) -> None:
        self._bins = np.zeros(self._HIGH - self._LOW + 1, np.int64)
        self.count = 0

    def add(self, periods: Words) -> None:
        """More of them; those that are not positive are left out."""
        periods = periods[periods > 0]
        if not len(periods):
            return
        code = (periods.astype(np.float32).view(np.int32) >> 13).clip(self._LOW, self._HIGH) - self._LOW
        low = int(code.min())
        counted = np.bincount(code - low)
        self._bins[low : low + len(counted)] += counted
        self.count += len(periods)

    def below(self, share: float) -> float:
        """The time that this share of them does not exceed."""
        at = int(np.searchsorted(np.cumsum(self._bins), share * self.count))
        low, high = (np.array([self._LOW + at + k << 13], np.int32).view(np.float32)[0] for k in (0, 1))
        return float(low + high) / 2
