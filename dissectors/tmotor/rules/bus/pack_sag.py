"""A pack whose voltage breaks down: every ESC says so at once."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from dissectors.kit import NO_TIME, Rule, breach
from dissectors.tmotor.rules.joined.joins import MOST_UNITS, units
from dissectors.tmotor.rules.joined.motion import Motion

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from dissectors.kit import DecodedTable, Occurrence, Occurrences, View
    from dissectors.tmotor.rules.joined.joins import ReportingEsc

_UNDER_VOLTAGE = 2  # bit 1 of the status word
_FEWEST = 2  # one ESC alone may have a loose plug


class _Moment(NamedTuple):
    """A report with or without under-voltage, or (without a row) motors that begin or cease to turn."""

    number: int
    row: int
    unit: ReportingEsc | None
    on: bool


class PackSag(Rule):
    """The ESCs that report under-voltage, and whether motors turn; an episode is told once, at a report."""

    rules = ("BUS-036",)

    def __init__(self) -> None:
        self._low: dict[ReportingEsc, bool] = {}
        self._motion = Motion()
        self._told: dict[int, bool] = {}

    def feed(self, view: View) -> Iterable[Occurrences | Occurrence]:
        """Follow the reports of this batch, one by one while an ESC has under-voltage."""
        turning = {bus: self._motion.turning(bus) for bus in range(len(view.buses))}
        moved = self._motion.feed(view)
        table = view.table("ESCStatus")
        if table is None or view.start == NO_TIME:
            return
        moments: dict[int, list[_Moment]] = {}
        for unit, rows in units(view).items():
            if unit in self._low or len(self._low) < MOST_UNITS:
                low = (table["error_count"][rows] & _UNDER_VOLTAGE) != 0
                if not low.any() and not self._low.get(unit, True):
                    continue
                numbers = table["transfer"][rows].tolist()
                some = zip(numbers, rows.tolist(), low.tolist(), strict=True)
                moments.setdefault(unit.bus, []).extend(_Moment(n, row, unit, on) for n, row, on in some)
        for bus, some_moments in moments.items():
            for number, _, on in zip(*moved.get(bus, ((), (), ())), strict=True):
                some_moments.append(_Moment(int(number), -1, None, bool(on)))
            yield from self._follow(view, table, sorted(some_moments, key=_order), turns=turning.get(bus, False))

    def _follow(self, view: View, table: DecodedTable, moments: list[_Moment], *, turns: bool) -> Iterator[Occurrence]:
        for moment in moments:
            if moment.unit is None:
                turns = moment.on
                continue
            bus = moment.unit.bus
            self._low[moment.unit] = moment.on
            escs = [low for unit, low in self._low.items() if unit.bus == bus]
            sags = len(escs) >= _FEWEST and all(escs)
            if sags and turns and not self._told.get(bus, False):
                self._told[bus] = True
                values = {"escs": len(escs), "volts": float(table["voltage"][moment.row])}
                yield breach(view, table, moment.row, "BUS-036", values, dialects={"dronecan": None})
            elif not sags:
                self._told[bus] = False


def _order(moment: _Moment) -> tuple[int, int]:
    return moment.number, moment.row
