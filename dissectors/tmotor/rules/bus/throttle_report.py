"""Throttle that an ESC reports against the throttle that it is commanded (4.4.1, 4.4.3)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import MILLISECOND, NO_TIME, SECOND, Occurrence, Rule, breach
from dissectors.records import dataclass, replace
from dissectors.tmotor.rules.joined.joins import FULL_THROTTLE, MOST_UNITS, LastCommands, esc_reports, fresh

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, View
    from dissectors.tmotor.rules.joined.joins import EscReports, ReportingEsc

_OPERATING = 4  # the mode in which an ESC does what it is told
_FAULTS = 0xFFF  # with any of these bits it may do less, and says so (TYP-305)


@dataclass(slots=True)
class _Run:
    """Reports of an ESC that are off, one after the other: since when, how many, the first one, whether it was told."""

    since: int = NO_TIME
    reports: int = 0
    place: Occurrence | None = None
    told: bool = False


class ReportedThrottle(Rule):
    """Joins each report with the command before it."""

    rules = ("BUS-040",)

    def __init__(self) -> None:
        self._last = LastCommands()
        self._runs: dict[ReportingEsc, _Run] = {}

    def feed(self, view: View) -> Iterator[Occurrence]:
        """Yield runs that last."""
        reports = esc_reports(view)
        if view.start != NO_TIME and reports is not None:
            wanted, off = self._off(view, reports)
            for unit, part, any_off in zip(reports.escs, reports.parts, reports.any(off), strict=True):
                run = self._runs.get(unit)
                if run is None and len(self._runs) < MOST_UNITS:
                    run = self._runs[unit] = _Run()
                if run is not None and (any_off or run.since != NO_TIME):
                    yield from self._follow(view, reports, unit, (part, wanted[part], off[part]))
        self._last.feed(view)

    def _off(self, view: View, reports: EscReports) -> tuple[Array, Array]:
        """Return the throttle in % that each report should have, and which ones differ from it for no reason."""
        command = self._last.at_reports(view, reports)
        timeout = round(view.number("BUS-007", "timeout_ms") * MILLISECOND)
        wanted = command.cmd * 100 / FULL_THROTTLE
        off = np.abs(reports.column("power_rating_pct") - wanted) > view.number("BUS-040", "off_pct")
        word = reports.column("error_count").astype(np.int64)
        off &= fresh(reports.t, command.t, timeout) & (command.cmd >= 0)
        off &= (word >> 12 & 15 == _OPERATING) & (word & _FAULTS == 0)
        return wanted, off

    def _follow(
        self, view: View, reports: EscReports, unit: ReportingEsc, what: tuple[slice, Array, Array]
    ) -> Iterator[Occurrence]:
        """Follow reports of an ESC of which some may be off, one by one."""
        (part, wanted, off), table, run = what, reports.table, self._runs[unit]
        lasts = view.number("BUS-040", "lasts_s") * SECOND
        for k, row in enumerate(reports.rows[part].tolist()):
            t = int(table.t[row])
            if not off[k]:
                run = self._runs[unit] = _Run()
                continue
            if run.since == NO_TIME:
                said = {"channel": unit.index + 1, "wanted_pct": float(wanted[k])}
                said["pct"] = int(table["power_rating_pct"][row])
                run.since, run.place = t, breach(view, table, row, "BUS-040", said, held=True)
            run.reports += 1
            if run.place is not None and not run.told and t - run.since >= lasts:
                run.told = True
                values = {**run.place.values, "seconds": (t - run.since) / SECOND, "reports": run.reports}
                yield replace(run.place, values=values, dialects={"dronecan": None})
