"""A pack whose voltage breaks down: every ESC says so at once."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dissectors.kit import NO_TIME, Rule, breach, changes
from dissectors.records import dataclass
from dissectors.tmotor.rules.joined.joins import MOST_UNITS, units
from dissectors.tmotor.rules.joined.motion import Motion

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from dissectors.kit import Array, DecodedTable, Occurrence, Occurrences, View
    from dissectors.tmotor.rules.joined.joins import ReportingEsc
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
        table = view.table("ESCStatus")
        if table is None or view.start == NO_TIME:
            return
        steps: dict[int, list[_Steps]] = {}
        reports: dict[int, list[Array]] = {}
        room = len(self._low) < MOST_UNITS
        for unit, rows in units(view).items():
            if room or unit in self._low:
                steps.setdefault(unit.bus, []).append(self._steps(table, unit, rows))
                reports.setdefault(unit.bus, []).append(rows)
        for bus, parts in steps.items():
            pack = self._packs.setdefault(bus, _Pack())
            motion = turning.get(bus, False), moved.get(bus)
            yield from _follow(view, pack, _Steps(*map(np.concatenate, zip(*parts, strict=True))), motion, reports[bus])

    def _steps(self, table: DecodedTable, unit: ReportingEsc, rows: Array) -> _Steps:
        low = table["error_count"][rows] & _UNDER_VOLTAGE != 0
        before = self._low.get(unit)
        at = changes(low, bool(before))
        if before is None:
            at = np.union1d(at, 0)
        more = low[at].astype(np.int64)
        less = np.where(more, 0, -1)
        known = np.zeros(len(at), np.int64)
        if before is None:
            known[0], less[0] = 1, 0
        self._low[unit] = bool(low[-1])
        return _Steps(table["transfer"][rows[at]].astype(np.int64), more + less, known)


def _follow(
    view: View, pack: _Pack, steps: _Steps, motion: tuple[bool, Changes | None], reports: list[Array]
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
        rows, of = turns = turns or _while_turning(table, np.sort(np.concatenate(reports)), motion)
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
