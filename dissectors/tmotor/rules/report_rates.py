"""How often ESCs report: as configured, without a break, and not more than the bus can take."""

from __future__ import annotations

from collections import Counter, deque
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from dissectors.conformance import MILLISECOND, NO_TIME, SECOND, Occurrence, Watcher
from dissectors.tmotor.rules.joins import MOST_UNITS, Pauses, Periods, Unit, commands, units
from dissectors.tmotor.rules.rows import breach, frames_of, sender, usable

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from dissectors.conformance import Found, Table, View, Words

_OPEN = 0xFFFF  # no rate
_FRAMES_A_REPORT = 3
MOST_MEASURED = 256  # nodes
_MEMORY = 15  # periods that say what is usual
_LATER = 2 * SECOND  # by then a node has said that it restarted
_AROUND = SECOND
_STRAY = 0.1  # an index with a smaller share of the reports is no ESC of its own
_FEW = 7  # bytes that one frame holds
_SKIPS = 0.25  # a larger share of transfer IDs that do not count up by 1 says nothing of what was lost


@dataclass(slots=True)
class _Measured:
    """The reports of a node since its rate was last set.

    `periods` are those of all reports by their transfer IDs, `heard` the times between those of one index. `skipped`
    of `counted` IDs are not that of the report before plus 1.
    """

    configured: int | None = None
    periods: Periods = field(default_factory=Periods)
    heard: Periods = field(default_factory=Periods)
    skipped: int = 0
    counted: int = 0
    latest: dict[int, int] = field(default_factory=dict)
    indexes: Counter[int] = field(default_factory=Counter)
    first: int = NO_TIME
    last: int = NO_TIME
    place: Occurrence | None = None

    def restart(self) -> None:
        self.periods, self.indexes, self.first = Periods(), Counter(), NO_TIME
        self.heard, self.skipped, self.counted, self.latest = Periods(), 0, 0, {}


class ReportRate(Watcher):
    """The rate of ESCStatus against that of the last ParamGet; the first 256 nodes."""

    rules = ("BUS-018",)

    def __init__(self) -> None:
        self._nodes: dict[tuple[int, int], _Measured] = {}
        self._set = False  # whether somebody has set a rate

    def look(self, view: View) -> Iterable[Found | Occurrence]:
        """Measures between the reports of parameters, in the order of transfers."""
        if view.start == NO_TIME:
            return
        done: dict[tuple[int, int], int] = {}
        parameters, settings = view.table("ParamGet"), view.table("ParamCfg")
        periods = _periods(view)
        sets = [] if settings is None else _numbers(settings, usable(settings) & (settings["esc_fdb_rate"] != _OPEN))
        if parameters is not None:
            for row in _changes(parameters):
                number, who = int(parameters["transfer"][row]), (int(parameters.bus[row]), int(parameters.src[row]))
                one = self._measured(who)
                if one is None:
                    continue
                configured = int(parameters["esc_fdb_rate"][row])
                if configured == one.configured:
                    continue
                self._measure(view, who, periods, (done.get(who, -1), number))
                done[who] = number
                known = self._set or any(before < number for before in sets)
                if one.configured is not None or known:
                    yield from _judged(view, one)
                    one.restart()
                one.configured = configured
                one.place = breach(view, parameters, row, "BUS-018", {}, held=True)
        for who in {(unit.bus, unit.node) for unit in units(view)}:
            if self._measured(who) is not None:
                self._measure(view, who, periods, (done.get(who, -1), None))
        self._set = self._set or bool(sets)

    def settle(self, view: View) -> Iterable[Found | Occurrence]:
        """The last settings."""
        for one in self._nodes.values():
            yield from _judged(view, one)

    def _measured(self, who: tuple[int, int]) -> _Measured | None:
        if who not in self._nodes and len(self._nodes) >= MOST_MEASURED:
            return None
        return self._nodes.setdefault(who, _Measured())

    def _measure(self, view: View, who: tuple[int, int], periods: Words, span: tuple[int, int | None]) -> None:
        """Takes the reports between two transfers."""
        table, one, (after, before) = view.table("ESCStatus"), self._nodes[who], span
        for unit, every in units(view).items():
            if table is None or (unit.bus, unit.node) != who:
                continue
            rows = every
            if after >= 0 or before is not None:
                number = table["transfer"][every].astype(np.int64)
                rows = every[(number > after) & (number < (number[-1] + 1 if before is None else before))]
            if not len(rows):
                continue
            one.indexes[unit.index] += len(rows)
            one.first = int(table.t[rows[0]]) if one.first == NO_TIME else one.first
            one.last = int(table.t[rows[-1]])
            one.periods.add(periods[rows])
            t, row = table.t[rows], table.row[rows]
            one.heard.add(np.diff(t, prepend=one.latest.get(unit.index, t[0])))
            one.latest[unit.index] = one.last
            steps = view.transfers.step[row][view.transfers.has("step")[row]]
            one.counted += len(steps)
            one.skipped += int(np.count_nonzero(steps != 1))


def _periods(view: View) -> Words:
    """The period of each ESCStatus, 0 if unknown; lost ones are counted by the transfer ID."""
    table, transfers = view.table("ESCStatus"), view.transfers
    if table is None:
        return np.empty(0, np.int64)
    row = table.row
    gap, step = transfers.gap[row].astype(np.int64), transfers.step[row].astype(np.int64)
    good = transfers.has("gap")[row] & transfers.has("step")[row] & (step > 0)
    return np.where(good, gap // np.maximum(step, 1), 0)


def _changes(table: Table) -> Iterator[int]:
    """Usable ParamGet, in order, without those that say the same rate as the node's one before in the batch."""
    rows = np.flatnonzero(usable(table))
    node, rate = sender(table, rows), table["esc_fdb_rate"][rows]
    order = np.argsort(node, kind="stable")
    node, rate = node[order], rate[order]
    same = (node[1:] == node[:-1]) & (rate[1:] == rate[:-1])
    yield from np.sort(rows[order[np.concatenate(([True], ~same))[: len(rows)]]]).tolist()


def _numbers(table: Table, rows: Words) -> list[int]:
    return [int(number) for number in table["transfer"][np.flatnonzero(rows)]]


def _judged(view: View, one: _Measured) -> Iterator[Occurrence]:
    """A rate that is not as configured."""
    enough = one.periods.count + 1 >= view.number("BUS-018", "min_transfers")
    if one.configured is None or one.configured == _OPEN or one.place is None or not enough:
        return
    if one.last - one.first < view.number("BUS-018", "min_s") * SECOND:
        return
    escs = sum(count > max(one.indexes.values()) * _STRAY for count in one.indexes.values())
    measures = [(one.periods.below(0.5), escs)]
    if one.skipped > _SKIPS * one.counted and one.heard.count:
        # Lost, or never sent? What is as configured either way is right.
        measures.append((one.heard.below(0.5), 1))
    tolerance = view.number("BUS-018", "tolerance_pct") / 100 * one.configured
    if not any(_fits(one.configured, tolerance, period, escs, view.resolution) for period, escs in measures):
        period, escs = measures[-1]
        yield replace(one.place, values={"configured": one.configured, "measured": SECOND / period / escs})


def _fits(rate: int, tolerance: float, period: float, escs: int, coarse: int) -> bool:
    """Whether a period may be that of so many ESCs at a rate; it is known no better than times are."""
    least, most = (SECOND / max(period + way * coarse, 1) / escs for way in (1, -1))
    return least - tolerance <= rate <= most + tolerance


class Predicted(Watcher):
    """The sum of all configured rates, with the commands that there were."""

    rules = ("BUS-024",)

    def __init__(self) -> None:
        self._rates: dict[int, dict[int, int]] = {}
        self._place: dict[int, Occurrence] = {}
        self._sent: dict[int, list[int]] = {}  # frames of commands, first and last time by bus

    def look(self, view: View) -> Iterable[Found | Occurrence]:
        """Collects rates and commands."""
        for bus, sent in commands(view).items():
            length = view.transfers.length[sent.table.row[sent.rows]]
            frames = int(np.where(length <= _FEW, 1, (length + 8) // _FEW).sum())
            entry = self._sent.setdefault(bus, [0, int(sent.t[0]), 0])
            entry[0], entry[2] = entry[0] + frames, int(sent.t[-1])
        table = view.table("ParamGet")
        if table is not None:
            for row in np.flatnonzero(usable(table) & (table["esc_fdb_rate"] != _OPEN)).tolist():
                bus, node, rate = int(table.bus[row]), int(table.src[row]), int(table["esc_fdb_rate"][row])
                if self._rates.setdefault(bus, {}).get(node) == rate:
                    continue
                self._rates[bus][node] = rate
                self._place[bus] = breach(view, table, row, "BUS-024", {}, held=True, node=None)
        yield from ()

    def settle(self, view: View) -> Iterable[Found | Occurrence]:
        """Adds up."""
        limit = int(view.number("BUS-024", "limit_per_s"))
        for bus, rates in self._rates.items():
            sent, first, last = self._sent.get(bus, (0, 0, 0))
            total = _FRAMES_A_REPORT * sum(rates.values()) + (sent * SECOND // (last - first) if last > first else 0)
            if total > limit:
                yield replace(self._place[bus], values={"frames": total, "limit": limit})


@dataclass(slots=True, eq=False)
class _Heard:
    """The last reports of an ESC."""

    t: Words
    frames: tuple[int, ...] = ()
    lines: tuple[str, ...] = ()


class Dropout(Watcher):
    """Breaks in the reports of an ESC."""

    rules = ("BUS-025",)

    def __init__(self) -> None:
        self._heard: dict[Unit, _Heard] = {}
        self._pauses: Pauses | None = None
        self._waiting: list[tuple[int, Occurrence]] = []  # until it is known whether the node restarted
        self._uptimes: dict[tuple[int, int], int] = {}
        self._starts: deque[tuple[int, int, int]] = deque(maxlen=MOST_UNITS)  # bus, node (-1 all), time

    def look(self, view: View) -> Iterable[Found | Occurrence]:
        """Looks at the times between reports."""
        if view.start == NO_TIME:
            return
        least = round(view.number("BUS-025", "min_ms") * MILLISECOND)
        self._pauses = self._pauses or Pauses(least)
        self._pauses.add(view)
        self._note_starts(view)
        table = view.table("ESCStatus")
        for unit, rows in units(view).items():
            if table is not None and (unit in self._heard or len(self._heard) < MOST_UNITS):
                self._breaks(view, unit, (table, rows), least)
        yield from self._judged(view.end - _LATER)

    def settle(self, view: View) -> Iterable[Found | Occurrence]:
        """ESCs that are silent to the end."""
        if self._pauses is not None:
            for unit, heard in self._heard.items():
                last = self._pauses.last.get(unit.bus, int(heard.t[-1]))
                if last - int(heard.t[-1]) > view.number("BUS-025", "min_ms") * MILLISECOND:
                    self._silent(view, unit, np.append(heard.t, last), len(heard.t) - 1, (heard.frames, heard.lines))
        yield from self._judged(None)

    def _breaks(self, view: View, unit: Unit, what: tuple[Table, Words], least: int) -> None:
        table, rows = what
        known = self._heard.get(unit, _Heard(np.empty(0, np.int64)))
        t, old = np.concatenate((known.t, table.t[rows])), len(known.t)
        took = np.diff(t)
        at = np.flatnonzero(took[max(old - 1, 0) :] > least) + max(old - 1, 0)
        full = at[at >= _MEMORY]
        if len(full):
            usual = np.median(np.lib.stride_tricks.sliding_window_view(took, _MEMORY)[full - _MEMORY], axis=1)
            long = took[full] > view.number("BUS-025", "periods") * usual
            at = np.concatenate((at[at < _MEMORY], full[long]))
        for k in at.tolist():
            if k >= old:
                frames = frames_of(view, table, int(rows[k - old]))
                evidence = frames, view.lines(frames)
            else:
                evidence = known.frames, known.lines
            self._silent(view, unit, t, k, evidence)
        frames = frames_of(view, table, int(rows[-1]))
        self._heard[unit] = _Heard(t[-_MEMORY - 1 :].copy(), frames, view.lines(frames))

    def _silent(
        self, view: View, unit: Unit, t: Words, k: int, evidence: tuple[tuple[int, ...], tuple[str, ...]]
    ) -> None:
        """Remembers a break behind report `k`, if it is one."""
        anew = max((at for bus, node, at in self._starts
                    if bus == unit.bus and node in (-1, unit.node) and at <= t[k]), default=NO_TIME)  # fmt: skip
        recent = t[max(k - _MEMORY, 0) : k + 1]
        periods = np.diff(recent[recent >= anew])
        if len(periods) + 1 < view.number("BUS-025", "min_reports") or self._pauses is None:
            return
        usual, start, stop = float(np.median(periods)), int(t[k]), int(t[k + 1])
        silent = stop - start - self._pauses.inside(unit.bus, start, stop)
        least = view.number("BUS-025", "min_ms") * MILLISECOND
        if silent > max(view.number("BUS-025", "periods") * usual, least) and len(self._waiting) < MOST_UNITS:
            frames, lines = evidence
            values = {
                "esc_index": unit.index, "milliseconds": silent / MILLISECOND, "period_ms": usual / MILLISECOND,
            }  # fmt: skip
            found = Occurrence("BUS-025", start, unit.bus, unit.node, "ESCStatus", frames, values, lines=lines)
            self._waiting.append((stop, found))

    def _note_starts(self, view: View) -> None:
        """Restarts of nodes, and new report rates."""
        status = view.table("uavcan.protocol.NodeStatus")
        if status is not None:
            rows = np.flatnonzero(usable(status))
            columns = (column[rows].tolist() for column in (status.bus, status.src, status.t, status["uptime_sec"]))
            for bus, node, t, uptime in zip(*columns, strict=True):
                who = bus, node
                if uptime < self._uptimes.get(who, 0):
                    self._starts.append((bus, node, t - uptime * SECOND))
                if who in self._uptimes or len(self._uptimes) < MOST_UNITS:
                    self._uptimes[who] = uptime
        for name, column in (("ParamCfg", "esc_fdb_rate"), ("PUSHSCI.FocParameters", "report_rate")):
            table = view.table(name)
            if table is not None:
                for row in np.flatnonzero(table.trusted & (table[column] != _OPEN)).tolist():
                    self._starts.append((int(table.bus[row]), -1, int(table.t[row])))

    def _judged(self, end: int | None) -> Iterator[Occurrence]:
        ready = [one for one in self._waiting if end is None or one[0] < end]
        self._waiting = [one for one in self._waiting if not (end is None or one[0] < end)]
        for stop, found in ready:
            if not any(
                bus == found.bus and node in (-1, found.node) and found.t - _AROUND <= t <= stop + _AROUND
                for bus, node, t in self._starts
            ):
                yield found


WATCHERS: tuple[type[Watcher], ...] = (ReportRate, Predicted, Dropout)
