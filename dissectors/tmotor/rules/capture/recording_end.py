"""A recording that ends while motors turn."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import NO_TIME, SECOND, Occurrence, Rule, times_by_bus
from dissectors.tmotor.rules.joined.joins import MOST_UNITS, commands, units

if TYPE_CHECKING:
    from collections.abc import Iterable

    from dissectors.kit import Occurrences, View
    from dissectors.tmotor.rules.joined.joins import ReportingEsc


class RecordingEnds(Rule):
    """The last report of each ESC and the last throttle of each bus; the first `MOST_UNITS` ESCs count."""

    rules = ("CAP-005",)

    def __init__(self) -> None:
        self._reports: dict[ReportingEsc, tuple[int, int]] = {}  # time, rpm
        self._throttle: dict[int, tuple[int, int]] = {}  # time, channels above 0
        self._end: dict[int, int] = {}

    def feed(self, view: View) -> Iterable[Occurrences | Occurrence]:
        """Remember what came last."""
        if view.start != NO_TIME:
            for one in times_by_bus(view.frames):
                self._end[one.bus] = int(one.t[-1])
            table = view.table("ESCStatus")
            for unit, rows in units(view).items():
                if table is not None and (unit in self._reports or len(self._reports) < MOST_UNITS):
                    self._reports[unit] = int(table.t[rows[-1]]), abs(int(table["rpm"][rows[-1]]))
            for bus, sent in commands(view).items():
                self._throttle[bus] = int(sent.t[-1]), int(np.count_nonzero(sent.cmd[:, -1] > 0))
        return ()

    def finish(self, view: View) -> Iterable[Occurrences | Occurrence]:
        """Yield the buses where something turned, or was driven, within the last second."""
        recent = view.number("CAP-005", "recent_s") * SECOND
        for bus, end in self._end.items():
            speeds = [rpm for unit, (t, rpm) in self._reports.items() if unit.bus == bus and end - t <= recent and rpm]
            t, driven = self._throttle.get(bus, (NO_TIME, 0))
            if speeds or (driven and end - t <= recent):
                turning = (
                    f"{_plural(len(speeds), 'ESC')} at up to {max(speeds)} rpm" if speeds else "no ESC told a speed"
                )
                values = {"turning": turning, "driven": _plural(driven, "channel")}
                yield Occurrence("CAP-005", end, bus, None, "", (), values)


def _plural(count: int, noun: str) -> str:
    return f"{count} {noun}{'' if count == 1 else 's'}"
