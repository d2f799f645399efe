"""Restarts of ESCs by their own counters, for those that send no NodeStatus."""

from __future__ import annotations

from itertools import pairwise
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
            # A node that turns out to send the high byte first begins anew: its numbers before were read wrongly.
            which = packets["unit_id"].astype(np.int64) << 1 | packets["big_endian"]
            yield from self._follow(packets, sound(packets), which, "power_on_count")
        if answers is not None:
            yield from self._follow(answers, usable(answers), answers["esc_uuid"], "esc_startup_times")

    def _follow(self, table: DecodedTable, good: Array, which: Array, column: str) -> Iterator[PowerOn]:
        rows = np.flatnonzero(good & (table.t != NO_TIME))
        key = sender(table, rows).astype(np.int64) << 32 | which[rows].astype(np.int64)
        order, begins = by_key(key)
        rows, every = rows[order], table.t[rows[order]]
        all_counts = table[column][rows].astype(np.int64)
        all_ran = table["runtime"][rows].astype(np.int64) if "runtime" in table else np.zeros(len(rows), np.int64)
        differs = np.flatnonzero((np.diff(all_counts) != 0) | (np.diff(all_ran) < 0)) + 1
        for start, stop in pairwise([*begins.tolist(), len(rows)]):
            unit, part = int(key[order[start]]), slice(start, stop)
            mine, t, counts, ran = rows[part], every[part], all_counts[part], all_ran[part]
            who = unit >> 32, unit & 0xFFFFFFFF, column
            first = int(counts[0])
            last = self._last.get(who, _Count(int(t[0]), first, int(ran[0]), first))
            best = last.best
            odd = (differs[slice(*np.searchsorted(differs, (start + 1, stop)))] - start).tolist()
            for k in [0, *odd] if first != last.powered or ran[0] < last.runtime else odd:
                since, now, powered = int(t[k - 1]) if k else last.t, int(t[k]), int(counts[k])
                before, runtime = int(ran[k - 1]) if k else last.runtime, int(ran[k])
                more, most = (powered - best) % _WRAP, (now - since) // SECOND + _SLACK
                if 0 < more <= most:
                    yield PowerOn(table, int(mine[k]), "power-on count", best, powered, since, now)
                elif runtime <= most < before and (runtime - before) % _WRAP > most:
                    yield PowerOn(table, int(mine[k]), "runtime", before, runtime, since, now)
                best = powered if more < _WRAP // 2 else best
            if who in self._last or len(self._last) < MOST_UNITS:
                self._last[who] = _Count(int(t[-1]), int(counts[-1]), int(ran[-1]), best)


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
