"""Restarts of ESCs by their own counters, for those that send no NodeStatus."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dissectors.kit import NO_TIME, SECOND, Occurrence, Rule, Starts, breach, by_key, sender, sound, usable
from dissectors.tmotor.rules.joined.joins import MOST_UNITS

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, DecodedTable, View

_WRAP = 1 << 16
_SLACK = 2  # s, of clocks that count whole seconds; nobody starts more often than once a second
_LATER = 5 * SECOND // 2  # by then a node has said that it restarted


class PowerOn(NamedTuple):
    """A start of a device between two of its reports: the table of the later one, its row, and both times.

    `counter` went from `before` to `after`.
    """

    table: DecodedTable
    row: int
    counter: str
    before: int
    after: int
    since: int
    t: int


class _Count(NamedTuple):
    """The last report of a unit: its time, its count and runtime, and the highest count so far."""

    t: int
    powered: int
    runtime: int
    best: int


_PACKETS, _ANSWERS = "power_on_count", "esc_startup_times"  # their columns


class _Units(NamedTuple):
    """Reports of one kind in a batch, one unit after the other: their keys, and where each begins.

    Counts and runtimes are those of `rows`; `begin` and `end` are time, count and runtime of the first one and the last
    one of each unit, `odd` are places where they do not go on as from the one before.
    """

    keys: list[int]
    first: list[int]
    begin: list[tuple[int, int, int]]
    end: list[tuple[int, int, int]]
    rows: Array
    t: Array
    counts: Array
    ran: Array
    odd: list[list[int]]


def _of_packets(table: DecodedTable) -> _Units:
    """Return what status packets report."""
    rows = np.flatnonzero(sound(table) & (table.t != NO_TIME))
    # A node that turns out to send the high byte first begins anew: its numbers before were read wrongly.
    which = table["unit_id"][rows].astype(np.int64) << 1 | table["big_endian"][rows]
    return _units(table, rows, which, _PACKETS)


def _of_answers(table: DecodedTable) -> _Units:
    """Return what parameters report."""
    rows = np.flatnonzero(usable(table) & (table.t != NO_TIME))
    return _units(table, rows, table["esc_uuid"][rows].astype(np.int64), _ANSWERS)


def _units(table: DecodedTable, rows: Array, which: Array, column: str) -> _Units:
    """Return the reports in some rows, each of which is of one of the units of its sender."""
    key = sender(table, rows).astype(np.int64) << 32 | which
    order, begins = by_key(key)
    rows, keys = rows[order], key[order[begins]].tolist()
    counts = table[column][rows].astype(np.int64)
    ran = table["runtime"][rows].astype(np.int64) if "runtime" in table else np.zeros(len(rows), np.int64)
    differs = (counts[1:] != counts[:-1]) | (ran[1:] < ran[:-1])
    differs[begins[1:] - 1] = False
    at = np.flatnonzero(differs) + 1
    odd: list[list[int]] = [[] for _ in keys]
    for k, place in zip((np.searchsorted(begins, at, "right") - 1).tolist(), at.tolist(), strict=True):
        odd[k].append(place)
    t = table.t[rows]
    begin, end = (
        list(zip(*(column[at].tolist() for column in (t, counts, ran)), strict=True))
        for at in (begins, np.append(begins[1:], len(rows))[: len(begins)] - 1)
    )
    return _Units(keys, begins.tolist(), begin, end, rows, t, counts, ran, odd)


class PowerOns:
    """Follows power-on count and runtime of each unit (4.4.5 no 24-27), and the count of each ESC (4.4.6 no 21-22).

    A runtime that falls says that the unit began anew only if it has counted from 0 since the last report.
    """

    def __init__(self) -> None:
        self._last: dict[tuple[int, int, str], _Count] = {}  # by sender, unit and column

    def feed(self, view: View) -> Iterator[PowerOn]:
        """Yield starts in a batch."""
        packets, answers = view.table("PUSHCAN.MotorStatus"), view.table("ParamGet")
        if packets is not None:
            yield from self._follow(packets, packets.once(_of_packets), _PACKETS)
        if answers is not None:
            yield from self._follow(answers, answers.once(_of_answers), _ANSWERS)

    def _follow(self, table: DecodedTable, units: _Units, column: str) -> Iterator[PowerOn]:
        rows, t, counts, ran = units.rows, units.t, units.counts, units.ran
        for unit, start, begin, end, odd in zip(
            units.keys, units.first, units.begin, units.end, units.odd, strict=True
        ):
            who, (at, first, runtime) = (unit >> 32, unit & 0xFFFFFFFF, column), begin
            last = self._last.get(who) or _Count(at, first, runtime, first)
            best = last.best
            for k in [start, *odd] if first != last.powered or runtime < last.runtime else odd:
                since, now, powered = t.item(k - 1) if k > start else last.t, t.item(k), counts.item(k)
                before, runtime = ran.item(k - 1) if k > start else last.runtime, ran.item(k)
                more, most = (powered - best) % _WRAP, (now - since) // SECOND + _SLACK
                if 0 < more <= most:
                    yield PowerOn(table, rows.item(k), "power-on count", best, powered, since, now)
                elif runtime <= most < before and (runtime - before) % _WRAP > most:
                    yield PowerOn(table, rows.item(k), "runtime", before, runtime, since, now)
                best = powered if more < _WRAP // 2 else best
            if who in self._last or len(self._last) < MOST_UNITS:
                self._last[who] = _Count(*end, best)


class Restarts(Rule):
    """Restarts by these counters; a node that says so itself is told by its uptime (BUS-021)."""

    rules = ("BUS-037",)

    def __init__(self) -> None:
        self._power_ons = PowerOns()
        self._starts = Starts()
        self._waiting: list[tuple[int, Occurrence]] = []
        self._told: dict[tuple[int, int], int] = {}  # when each node last began anew

    def feed(self, view: View) -> Iterator[Occurrence]:
        """Look at every count, and wait for the uptime."""
        self._starts.feed(view)
        for one in self._power_ons.feed(view):
            values = {"counter": one.counter, "before": one.before, "value": one.after}
            name = one.table.name.partition(".")[0]
            found = breach(view, one.table, one.row, "BUS-037", values, held=True, type=name)
            self._waiting.append((one.since, found))
        yield from self._ripe(view.end)

    def finish(self, _view: View) -> Iterator[Occurrence]:
        """Tell what waits for an uptime."""
        yield from self._ripe(None)

    def _ripe(self, now: int | None) -> Iterator[Occurrence]:
        waiting, self._waiting = self._waiting, []
        for since, found in waiting:
            node = found.node or 0
            if now is not None and now <= found.t + _LATER and len(waiting) <= MOST_UNITS:
                self._waiting.append((since, found))
            elif self._told.get((found.bus, node), NO_TIME) < since:  # else another count has told it
                self._told[found.bus, node] = found.t
                if not self._starts.between(found.bus, node, since, found.t, found.t + _LATER):
                    yield found
