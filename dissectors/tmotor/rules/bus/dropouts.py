"""Breaks in the reports of ESCs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import MILLISECOND, NO_TIME, SECOND, Break, Occurrence, Pauses, Rule, Starts
from dissectors.records import dataclass
from dissectors.tmotor.rules.bus.malformed import MalformedReports
from dissectors.tmotor.rules.bus.power_ons import PowerOns
from dissectors.tmotor.rules.bus.report_rate import OPEN
from dissectors.tmotor.rules.joined.joins import MOST_UNITS, ReportingEsc, esc_reports, evidence, last_reports

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from dissectors.kit import Occurrences, PacedReports, View
    from dissectors.tmotor.rules.joined.joins import EscReports, Evidence

_SHARE = 10 * SECOND  # of a silence: where frames are lost in it, the rest proves nothing


@dataclass(frozen=True, slots=True, eq=False)
class _Doubt:
    """A break until all is known that may explain it."""

    unit: ReportingEsc
    found: Break
    evidence: Evidence


class Dropouts(Rule):
    """Breaks in the reports of an ESC."""

    rules = ("BUS-025",)

    def __init__(self) -> None:
        self._heard: dict[ReportingEsc, Evidence] = {}  # the frames of the last report of each ESC
        self._places: dict[ReportingEsc, int] = {}  # in the same order
        self._paces: PacedReports | None = None  # of each ESC, in the same order
        self._pauses: Pauses | None = None
        self._starts = Starts()
        self._power_ons = PowerOns()
        self._malformed: MalformedReports | None = None
        self._doubts: list[_Doubt] = []

    def feed(self, view: View) -> Iterable[Occurrences | Occurrence]:
        """Look at the times between reports."""
        if view.start == NO_TIME:
            return
        least = round(view.number("BUS-025", "min_ms") * MILLISECOND)
        if self._pauses is None or self._paces is None or self._malformed is None:
            self._pauses, self._malformed = Pauses(least), MalformedReports(least)
            periods, fewest = (view.number("BUS-025", name) for name in ("periods", "min_reports"))
            self._paces = view.paced_reports(least, periods, int(fewest))
        self._pauses.feed(view)
        self._starts.feed(view)
        for one in self._power_ons.feed(view):
            self._starts.add(one.t, int(one.table.bus[one.row]), int(one.table.src[one.row]))
        self._note_rates(view)
        self._malformed.feed(view)
        reports = esc_reports(view)
        if reports is not None:
            self._breaks(view, reports, self._paces, self._malformed)
        yield from self._judge(view, view.end)

    def finish(self, view: View) -> Iterable[Occurrences | Occurrence]:
        """Yield ESCs that are silent to the end."""
        if self._pauses is not None and self._paces is not None:
            heard, ends = list(self._heard), self._pauses.last
            until = [ends.get(unit.bus, last) for unit, last in zip(heard, self._paces.last.tolist(), strict=True)]
            for k, found in self._paces.silences(np.array(until, np.int64)):
                self._doubts.append(_Doubt(heard[k], found, self._heard[heard[k]]))
        yield from self._judge(view, None)

    def _breaks(self, view: View, reports: EscReports, paces: PacedReports, malformed: MalformedReports) -> None:
        """Note times without reports of each ESC."""
        for esc in reports.escs:
            if len(self._places) < MOST_UNITS:
                self._places.setdefault(esc, len(self._places))
        some = [k for k, esc in enumerate(reports.escs) if esc in self._places]
        if not some:
            return
        escs, size = [reports.escs[k] for k in some], (reports.first[1:] - reports.first[:-1])[some]
        rows = np.concatenate([reports.rows[reports.parts[k]] for k in some])
        lost = malformed.lost([esc.bus for esc in escs], [esc.node for esc in escs], size, reports.table.row[rows])
        places = np.array([self._places[esc] for esc in escs])
        for k, found in paces.feed(places, size, reports.table.t[rows], lost):
            at = reports.parts[some[k]].start + found.at
            before = self._heard[escs[k]] if found.at < 0 else evidence(view, reports.table, reports.rows.item(at))
            if len(self._doubts) < MOST_UNITS:
                self._doubts.append(_Doubt(escs[k], found, before))
        self._heard |= {esc: last for esc, last in last_reports(view).items() if esc in self._places}

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
        if found.may_be_slower(now) or self._pauses is None or self._malformed is None:
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
