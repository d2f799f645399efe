"""Breaks in the reports of ESCs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import (
    MILLISECOND,
    NO_TIME,
    SECOND,
    Break,
    Occurrence,
    PacedReports,
    Pauses,
    Rule,
    Starts,
    frames_of,
)  # fmt: skip
from dissectors.records import dataclass
from dissectors.tmotor.rules.bus.malformed import MalformedReports
from dissectors.tmotor.rules.bus.power_ons import PowerOns
from dissectors.tmotor.rules.bus.report_rate import OPEN
from dissectors.tmotor.rules.joined.joins import MOST_UNITS, ReportingEsc, units

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from dissectors.kit import DecodedTable, Occurrences, View

_SHARE = 10 * SECOND  # of a silence: where frames are lost in it, the rest proves nothing
_Evidence = tuple[tuple[int, ...], tuple[str, ...]]


@dataclass(frozen=True, slots=True, eq=False)
class _Doubt:
    """A break until all is known that may explain it."""

    unit: ReportingEsc
    found: Break
    evidence: _Evidence


class Dropouts(Rule):
    """Breaks in the reports of an ESC."""

    rules = ("BUS-025",)

    def __init__(self) -> None:
        self._heard: dict[ReportingEsc, _Evidence] = {}  # the frames of the last report of each ESC
        self._paces = PacedReports(0, 0, 0)  # of each ESC, in the same order
        self._pauses: Pauses | None = None
        self._starts = Starts()
        self._power_ons = PowerOns()
        self._malformed = MalformedReports()
        self._doubts: list[_Doubt] = []

    def feed(self, view: View) -> Iterable[Occurrences | Occurrence]:
        """Look at the times between reports."""
        if view.start == NO_TIME:
            return
        least = round(view.number("BUS-025", "min_ms") * MILLISECOND)
        if self._pauses is None:
            self._pauses = Pauses(least)
            periods, fewest = (view.number("BUS-025", name) for name in ("periods", "min_reports"))
            self._paces = PacedReports(least, periods, int(fewest))
        self._pauses.feed(view)
        self._starts.feed(view)
        for one in self._power_ons.feed(view):
            self._starts.add(one.t, int(one.table.bus[one.row]), int(one.table.src[one.row]))
        self._note_rates(view)
        self._malformed.feed(view, least)
        table = view.table("ESCStatus")
        if table is not None:
            self._breaks(view, table)
        yield from self._judge(view, view.end)

    def finish(self, view: View) -> Iterable[Occurrences | Occurrence]:
        """Yield ESCs that are silent to the end."""
        if self._pauses is not None:
            heard, ends = list(self._heard), self._pauses.last
            until = [ends.get(unit.bus, last) for unit, last in zip(heard, self._paces.last.tolist(), strict=True)]
            for k, found in self._paces.silences(np.array(until, np.int64)):
                self._doubts.append(_Doubt(heard[k], found, self._heard[heard[k]]))
        yield from self._judge(view, None)

    def _breaks(self, view: View, table: DecodedTable) -> None:
        """Note times without reports of each ESC."""
        places = {unit: k for k, unit in enumerate(self._heard)}
        for unit in units(view):
            if len(places) < MOST_UNITS:
                places.setdefault(unit, len(places))
        reports = [(unit, rows) for unit, rows in units(view).items() if unit in places]
        if not reports:
            return
        breaks = self._paces.feed(
            np.array([places[unit] for unit, _ in reports]),
            np.array([len(rows) for _, rows in reports]),
            table.t[np.concatenate([rows for _, rows in reports])],
            np.concatenate([self._malformed.lost(unit, table.row[rows]) for unit, rows in reports]),
        )
        for k, found in breaks:
            unit, rows = reports[k]
            evidence = self._heard[unit] if found.at < 0 else _evidence(view, table, rows.item(found.at))
            if len(self._doubts) < MOST_UNITS:
                self._doubts.append(_Doubt(unit, found, evidence))
        for unit, rows in reports:
            self._heard[unit] = _evidence(view, table, rows.item(-1))

    def _note_rates(self, view: View) -> None:
        """Note new report rates."""
        for name, column in (("ParamCfg", "esc_fdb_rate"), ("PUSHSCI.FocParameters", "report_rate")):
            table = view.table(name)
            if table is not None:
                for row in np.flatnonzero(table.trusted & (table[column] != OPEN)).tolist():
                    self._starts.add(int(table.t[row]), int(table.bus[row]))

    def _judge(self, view: View, now: int | None) -> Iterator[Occurrence]:
        waiting = []
        for one in self._doubts:
            if one.found.due(now):
                yield from self._judged(view, one, view.end)
            else:
                waiting.append(one)
        self._doubts = waiting

    def _judged(self, view: View, doubt: _Doubt, now: int) -> Iterator[Occurrence]:
        """Yield a break that nothing explains."""
        unit, found = doubt.unit, doubt.found
        if found.may_be_slower(now) or self._pauses is None:
            return
        if self._starts.between(unit.bus, unit.node, found.start, found.stop, found.told):
            return
        pauses = self._pauses
        silent, start, stop = max(
            (stop - start - pauses.inside(unit.bus, start, stop, found.period), start, stop)
            for start, stop in self._malformed.between(unit, found.start, found.stop)
        )
        least = view.number("BUS-025", "min_ms") * MILLISECOND
        if silent <= max(view.number("BUS-025", "periods") * found.period, least):
            return
        heard = stop - start - pauses.inside(unit.bus, start, stop, SECOND)
        values = {
            "esc_index": unit.index, "milliseconds": heard / MILLISECOND, "period_ms": found.period / MILLISECOND,
        }  # fmt: skip
        frames, lines = doubt.evidence
        yield Occurrence(
            "BUS-025", start, unit.bus, unit.node, "ESCStatus", frames, values,
            drops=True, until=min(stop, start + _SHARE), lines=lines,
        )  # fmt: skip


def _evidence(view: View, table: DecodedTable, row: int) -> _Evidence:
    frames = frames_of(view, table, row)
    return frames, view.lines(frames)
