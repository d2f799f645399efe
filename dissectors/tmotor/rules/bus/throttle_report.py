"""Throttle that an ESC reports against the throttle that it is commanded (4.4.1, 4.4.3)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import MILLISECOND, NO_TIME, SECOND, Occurrence, Rule, breach
from dissectors.records import dataclass, replace
from dissectors.tmotor.rules.joined.joins import FULL_THROTTLE, MOST_UNITS, LastCommands, fresh, units

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, DecodedTable, View
    from dissectors.tmotor.rules.joined.joins import ReportingEsc

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
        table = view.table("ESCStatus")
        if view.start != NO_TIME and table is not None:
            for unit, rows in units(view).items():
                if unit in self._runs or len(self._runs) < MOST_UNITS:
                    yield from self._follow(view, table, unit, rows)
        self._last.feed(view)

    def _follow(self, view: View, table: DecodedTable, unit: ReportingEsc, rows: Array) -> Iterator[Occurrence]:
        run = self._runs.setdefault(unit, _Run())
        command = self._last.in_force(view, unit.bus, unit.index, table, rows)
        timeout = round(view.number("BUS-007", "timeout_ms") * MILLISECOND)
        judged, wanted = (
            fresh(table.t[rows], command.t, timeout) & (command.cmd >= 0),
            command.cmd * 100 / FULL_THROTTLE,
        )
        off = np.abs(table["power_rating_pct"][rows] - wanted) > view.number("BUS-040", "off_pct")
        word = table["error_count"][rows].astype(np.int64)
        judged &= (word >> 12 & 15 == _OPERATING) & (word & _FAULTS == 0)
        off &= judged
        if not off.any() and run.since == NO_TIME:
            return
        lasts = view.number("BUS-040", "lasts_s") * SECOND
        for k, row in enumerate(rows.tolist()):
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
