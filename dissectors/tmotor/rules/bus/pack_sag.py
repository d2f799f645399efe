"""A pack whose voltage breaks down: every ESC says so at once."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dissectors.kit import NO_TIME, Rule, breach, changes
from dissectors.records import dataclass
from dissectors.tmotor.rules.joined.joins import MOST_UNITS, esc_reports
from dissectors.tmotor.rules.joined.motion import Motion

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from dissectors.kit import Array, DecodedTable, Occurrence, Occurrences, View
    from dissectors.tmotor.rules.joined.joins import EscReports, ReportingEsc
    from dissectors.tmotor.rules.joined.motion import Changes

_UNDER_VOLTAGE = 2  # bit 1 of the status word
_FEWEST = 2  # one ESC alone may have a loose plug
_NEVER = np.iinfo(np.int64).max  # behind every transfer


class _Steps(NamedTuple):
    """News in reports of ESCs: transfers, how many more ESCs have under-voltage, how many more there are."""

    number: Array
    low: Array
    known: Array


@dataclass(slots=True)
class _Pack:
    """The ESCs of a bus: how many have under-voltage, how many there are, and whether it was told that all have it."""

    low: int = 0
    known: int = 0
    told: bool = False


class PackSag(Rule):
    """The ESCs that report under-voltage, and whether motors turn; an episode is told once, at a report."""

    rules = ("BUS-036",)

    def __init__(self) -> None:
        self._low: dict[ReportingEsc, bool] = {}
        self._motion = Motion()
        self._packs: dict[int, _Pack] = {}

    def feed(self, view: View) -> Iterable[Occurrences | Occurrence]:
        """Follow how many have under-voltage."""
        turning = {bus: self._motion.turning(bus) for bus in range(len(view.buses))}
        moved = self._motion.feed(view)
        reports = esc_reports(view)
        if reports is None or view.start == NO_TIME:
            return
        for bus, rows, steps in self._steps(reports):
            pack = self._packs.setdefault(bus, _Pack())
            yield from _follow(view, pack, steps, (turning.get(bus, False), moved.get(bus)), rows)

    def _steps(self, reports: EscReports) -> Iterator[tuple[int, Array, _Steps]]:
        """Yield the rows of each bus, of ESCs that count, and the news in them."""
        low = reports.column("error_count") & _UNDER_VOLTAGE != 0
        room = len(self._low) < MOST_UNITS
        known = np.array([esc in self._low for esc in reports.escs])
        before = reports.before(low, [self._low.get(esc, False) for esc in reports.escs])
        first = np.zeros(len(low), bool)
        first[reports.first[:-1]] = ~known
        changed = (low != before) | first
        if not room:
            changed &= known[reports.of]
        for esc, last, one in zip(reports.escs, low[reports.first[1:] - 1].tolist(), known.tolist(), strict=True):
            if room or one:
                self._low[esc] = last
        for bus, part in reports.by_bus():
            rows = reports.rows[part]
            if not room:
                rows = rows[known[reports.of[part]]]
            at = np.flatnonzero(changed[part]) + part.start
            step = np.where(low[at], 1, np.where(first[at], 0, -1))
            if len(rows):
                yield bus, rows, _Steps(reports.number[at], step, first[at].astype(np.int64))


def _follow(
    view: View, pack: _Pack, steps: _Steps, motion: tuple[bool, Changes | None], reports: Array
) -> Iterator[Occurrence]:
    """Yield the first report with motors turning of each time in which all ESCs have under-voltage."""
    table = view.table("ESCStatus")
    order = np.argsort(steps.number)
    number, low = steps.number[order], pack.low + np.cumsum(steps.low[order])
    known = pack.known + np.cumsum(steps.known[order])
    all_low = (known >= _FEWEST) & (low == known)
    sagged = pack.low == pack.known >= _FEWEST
    at = changes(all_low, sagged)
    begins, ends = number[at[all_low[at]]].tolist(), number[at[~all_low[at]]].tolist()
    spans = zip([-1, *begins] if sagged else begins, [*ends, _NEVER], strict=False)
    turns: tuple[Array, Array] | None = None
    for since, until in spans:
        pack.told &= since < 0
        if pack.told or table is None:
            continue
        rows, of = turns = turns or _while_turning(table, np.sort(reports), motion)
        k = int(np.searchsorted(of, since))
        if k < len(of) and of[k] < until:
            pack.told = True
            escs = [pack.known, *known.tolist()][int(np.searchsorted(number, of[k], "right"))]
            values = {"escs": escs, "volts": float(table["voltage"][rows[k]])}
            yield breach(view, table, int(rows[k]), "BUS-036", values, dialects={"dronecan": None})
    if len(number):
        pack.low, pack.known = int(low[-1]), int(known[-1])
    pack.told &= pack.low == pack.known >= _FEWEST


def _while_turning(table: DecodedTable, rows: Array, motion: tuple[bool, Changes | None]) -> tuple[Array, Array]:
    """Return the rows of reports while motors turn, and their transfers."""
    before, moved = motion
    number = table["transfer"][rows].astype(np.int64)
    turns = np.full(len(rows), before)
    if moved is not None:
        turns = np.append(before, moved.turning)[np.searchsorted(moved.number, number, "right")]
    return rows[turns], number[turns]
