"""The vehicle as a whole: its ESCs by index, who commands them, whether motors turn."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dissectors.conformance import MILLISECOND, NO_TIME, SECOND, Watcher
from dissectors.tmotor.rules.joins import MOST_UNITS, NO_CHANNEL, Motion, commands, units
from dissectors.tmotor.rules.rows import breach

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from dissectors.conformance import Exercise, Found, Occurrence, Table, View, Words
    from dissectors.tmotor.rules.joins import Commands, Unit


class Vehicle:
    """What the vehicle did: words for what rules need.

    `escs` are the indexes that each (bus, node) reported, `running_ns` is how long motors turned.
    """

    def __init__(self) -> None:
        self.escs: dict[tuple[int, int], set[int]] = {}
        self._words: set[str] = set()
        self._motion = Motion()
        self._since: dict[int, int] = {}
        self._ran: dict[int, int] = {}
        self._commanded: dict[int, int] = {}
        self._end = NO_TIME

    @property
    def running_ns(self) -> int:
        """Time with motors turning, on the bus with the most."""
        buses = self._ran.keys() | self._since.keys()
        going_on = {bus: max(self._end - since, 0) for bus, since in self._since.items()}
        return max((self._ran.get(bus, 0) + going_on.get(bus, 0) for bus in buses), default=0)

    def look(self, view: View) -> None:
        """The next batch."""
        for unit in units(view):
            if len(self.escs) < MOST_UNITS or (unit.bus, unit.node) in self.escs:
                self.escs.setdefault((unit.bus, unit.node), set()).add(unit.index)
        self._note_motion(view)
        self._note_commands(view)
        self._end = view.end

    def words(self) -> Iterable[str]:
        """What was there."""
        if sum(map(len, self.escs.values())) > 1:
            self._words.add("several ESCs")
        return self._words

    def facts(self) -> dict[str, float]:
        """How many ESCs there are, on all buses that repeat each other, and seconds with motors turning."""
        escs = {(node, index) for (_, node), indexes in self.escs.items() for index in indexes}
        return {"escs": len(escs), "running_s": self.running_ns / SECOND}

    def _note_motion(self, view: View) -> None:
        started = {bus: _first(view, bus) for bus in range(len(view.buses)) if not self._motion.known(bus)}
        changes = self._motion.add(view)
        for bus, (number, times, on) in changes.items():
            if len(on) and (not on.all() or number[0] > started.get(bus, number[0])):
                self._words.add("motors at rest")
            if len(on):
                self._words.add("motors running")
            for t, turning in zip(times.tolist(), on.tolist(), strict=True):
                if turning:
                    self._since[bus] = t
                elif bus in self._since:
                    self._ran[bus] = self._ran.get(bus, 0) + max(t - self._since.pop(bus), 0)
        if "motors at rest" not in self._words and any(
            self._motion.known(bus) and not self._motion.turning(bus) for bus in range(len(view.buses))
        ):
            self._words.add("motors at rest")

    def _note_commands(self, view: View) -> None:
        for bus, sent in commands(view).items():
            if "negative throttle" not in self._words and ((sent.cmd < 0) & (sent.cmd != NO_CHANNEL)).any():
                self._words |= {"negative throttle", "bad throttle"}
            last = self._commanded.get(bus, int(sent.t[0]))
            if "bad throttle" not in self._words and (np.diff(sent.t, prepend=last) > 100 * MILLISECOND).any():
                self._words.add("bad throttle")
            self._commanded[bus] = int(sent.t[-1])
        if any(view.end - t > 100 * MILLISECOND for t in self._commanded.values()):
            self._words.add("bad throttle")


def _first(view: View, bus: int) -> int:
    """The first transfer of this batch that tells something of a bus's motors; a large number without any."""
    table = view.table("ESCStatus")
    numbers = [int(table["transfer"][rows[0]]) for unit, rows in units(view).items() if table and unit.bus == bus]
    numbers += [int(sent.number[0]) for index, sent in commands(view).items() if index == bus]
    return min(numbers, default=1 << 62)


def labels(view: View) -> Iterator[tuple[int, int, str]]:
    """ESCs by the channel that people call them, which counts from 1."""
    for unit in units(view):
        yield unit.bus, unit.node, f"ch{unit.index + 1}"


class TooMany(Watcher):
    """More ESCs on one bus than the document recommends."""

    rules = ("BUS-008",)

    def __init__(self) -> None:
        self._nodes: dict[int, set[int]] = {}
        self._found: dict[int, Occurrence] = {}

    def look(self, view: View) -> Iterable[Found | Occurrence]:
        """Counts nodes; the place is the first report of the first one too many."""
        table, most = view.table("ESCStatus"), int(view.number("BUS-008", "max_nodes"))
        if table is None:
            return
        fresh: dict[tuple[int, int], int] = {}
        for unit, rows in units(view).items():
            if unit.node not in self._nodes.setdefault(unit.bus, set()):
                row = int(rows[0])
                fresh[unit.bus, unit.node] = min(row, fresh.get((unit.bus, unit.node), row))
        for (bus, node), row in sorted(fresh.items(), key=lambda one: one[1]):
            self._nodes[bus].add(node)
            if len(self._nodes[bus]) == most + 1:
                self._found[bus] = breach(view, table, row, "BUS-008", {}, held=True, node=None)
        yield from ()

    def settle(self, _view: View) -> Iterable[Found | Occurrence]:
        """How many there were in the end."""
        for bus, found in self._found.items():
            yield replace(found, values={"nodes": len(self._nodes[bus])})


class SameIndex(Watcher):
    """One index in the reports of two nodes."""

    rules = ("BUS-009",)

    def __init__(self) -> None:
        self._last: dict[tuple[int, int], tuple[int, int]] = {}  # (bus, index): node and time of the last report

    def look(self, view: View) -> Iterable[Found | Occurrence]:
        """Compares neighbours in the sequence of all reports with one index."""
        table = view.table("ESCStatus")
        if table is None or view.start == NO_TIME:
            return
        window = round(view.number("BUS-009", "window_s") * SECOND)
        together: dict[tuple[int, int], list[Words]] = {}
        for unit, rows in units(view).items():
            together.setdefault((unit.bus, unit.index), []).append(rows)
        for place, parts in together.items():
            rows = np.sort(np.concatenate(parts))
            node, t = self._last.get(place, (int(table.src[rows[0]]), int(table.t[rows[0]])))
            if len(parts) > 1 or node != table.src[rows[0]]:
                yield from _twos(view, table, rows, ("BUS-009", place[1]), (node, t), window)
            if place in self._last or len(self._last) < MOST_UNITS:
                self._last[place] = int(table.src[rows[-1]]), int(table.t[rows[-1]])


class TwoSources(Watcher):
    """Throttle from two nodes."""

    rules = ("BUS-023",)

    def __init__(self) -> None:
        self._last: dict[int, tuple[int, int]] = {}

    def look(self, view: View) -> Iterable[Found | Occurrence]:
        """Compares neighbours in the sequence of all commands of a bus."""
        if view.start == NO_TIME:
            return
        window = round(view.number("BUS-023", "window_s") * SECOND)
        for bus, sent in commands(view).items():
            last = self._last.get(bus, (int(sent.src[0]), int(sent.t[0])))
            if last[0] != sent.src[0] or (sent.src != sent.src[0]).any():
                yield from _twos(view, sent.table, sent.rows, ("BUS-023", None), last, window)
            self._last[bus] = int(sent.src[-1]), int(sent.t[-1])


def _twos(
    view: View, table: Table, rows: Words, what: tuple[str, int | None], last: tuple[int, int], window: int
) -> Iterator[Found]:
    """Rows that come from another node than the row before, within a window. `last` is the row before all of them."""
    rule, index = what
    src, t = table.src[rows].astype(np.int64), table.t[rows]
    before, since = np.concatenate(([last[0]], src[:-1])), t - np.concatenate(([last[1]], t[:-1]))
    at = np.flatnonzero((src != before) & (since < window))
    if not len(at):
        return
    low, high = np.minimum(src, before)[at], np.maximum(src, before)[at]
    place = {int(row): k for k, row in enumerate(rows[at])}

    def values(row: int) -> dict[str, int]:
        k = place[row]
        more = {} if index is None else {"esc_index": index}
        return {"first_node": int(low[k]), "second_node": int(high[k]), **more}

    found = view.among_rows(rule, table, rows[at], values, key=low * 128 + high if index is None else None)
    yield replace(found, node=high)


class NotCommanded(Watcher):
    """An ESC whose index is beyond the channels of the commands."""

    rules = ("BUS-026",)

    def __init__(self) -> None:
        self._sent: dict[int, _Sent] = {}

    def look(self, view: View) -> Iterable[Found | Occurrence]:
        """Compares each report with the commands of the time before it."""
        table = view.table("ESCStatus")
        if view.start == NO_TIME:
            return
        window = round(view.number("BUS-026", "window_s") * SECOND)
        now = commands(view)
        for unit, rows in units(view).items():
            sent = self._sent.get(unit.bus)
            if table is None or (sent is None and unit.bus not in now):
                continue
            yield from _uncommanded(view, table, (unit, rows), (sent or _Sent(), now.get(unit.bus)), window)
        for bus, fresh in now.items():
            self._sent.setdefault(bus, _Sent()).add(fresh, window)


class _Sent:
    """The commands of a bus so far: the last one, since when they run, when each index was last commanded."""

    def __init__(self) -> None:
        self.t = self.since = NO_TIME
        self.counts = 0
        self.with_index = np.full(32, NO_TIME)

    def add(self, sent: Commands, window: int) -> None:
        self.since = int(_runs(self, sent, window)[-1])
        most, least = int(sent.counts.max()), int(sent.counts.min())
        for count in {most, int(sent.counts[-1])} if most == least else set(sent.counts.tolist()):
            last = int(sent.t[np.flatnonzero(sent.counts == count)[-1]])
            self.with_index[:count] = np.maximum(self.with_index[:count], last)
        self.t, self.counts = int(sent.t[-1]), int(sent.counts[-1])


def _runs(before: _Sent, sent: Commands, window: int) -> Words:
    """For each command since when there has been no pause longer than the window."""
    return np.maximum.accumulate(np.where(sent.paused(before.t, window), sent.t, before.since))


def _uncommanded(
    view: View, table: Table, what: tuple[Unit, Words], commanded: tuple[_Sent, Commands | None], window: int
) -> Iterator[Found]:
    (unit, rows), (before, sent) = what, commanded
    if (sent is None or int(sent.counts.min()) > unit.index) and (before.t == NO_TIME or before.counts > unit.index):
        return
    columns = [np.array([v], np.int64) for v in (before.t, before.since, before.counts, before.with_index[unit.index])]
    if sent is not None:
        had = np.maximum.accumulate(np.where(sent.counts > unit.index, sent.t, before.with_index[unit.index]))
        fresh = (sent.t, _runs(before, sent, window), sent.counts, had)
        columns = [np.concatenate(pair) for pair in zip(columns, fresh, strict=True)]
    k = np.zeros(len(rows), np.int64) if sent is None else sent.before(table, rows)
    t = table.t[rows]
    last, since, counts, had = (column[k] for column in columns)
    runs = (last != NO_TIME) & (t - np.maximum(last, 0) <= window) & (t - np.maximum(since, 0) >= window)
    at = np.flatnonzero(runs & ((had == NO_TIME) | (t - np.maximum(had, 0) > window)))
    if len(at):
        shown = dict(zip(rows[at].tolist(), counts[at].tolist(), strict=True))
        yield view.among_rows("BUS-026", table, rows[at], lambda row: {"esc_index": unit.index, "channels": shown[row]})


class SpareChannels(Watcher):
    """Channels of commands for which no ESC ever reports."""

    rules = ("BUS-027",)

    def __init__(self) -> None:
        self._indexes: set[int] = set()
        self._first: dict[int, list[Occurrence]] = {}

    def look(self, view: View) -> Iterable[Found | Occurrence]:
        """Remembers indexes, and the first command with each channel."""
        self._indexes.update(unit.index for unit in units(view))
        for bus, sent in commands(view).items():
            known = self._first.setdefault(bus, [])
            for channel in range(len(known), len(sent.cmd)):
                row = int(sent.rows[np.flatnonzero(sent.counts > channel)[0]])
                known.append(breach(view, sent.table, row, "BUS-027", {"channel": channel + 1}, held=True))
        yield from ()

    def settle(self, _view: View) -> Iterable[Found | Occurrence]:
        """What never reported, if anything did."""
        if self._indexes:
            for known in self._first.values():
                yield from (one for one in known if int(one.values["channel"]) - 1 not in self._indexes)


EXERCISES: tuple[type[Exercise], ...] = (Vehicle,)
WATCHERS: tuple[type[Watcher], ...] = (TooMany, SameIndex, TwoSources, NotCommanded, SpareChannels)
