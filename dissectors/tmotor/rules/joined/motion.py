"""Motors that turn or rest."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from dissectors.kit import changes
from dissectors.tmotor.rules.joined.joins import MOST_UNITS, ReportingEsc, commands, end, units

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, DecodedTable, View

COMMANDS = -1  # in place of a node: the throttle on a bus


class Changes(NamedTuple):
    """Where motors of a bus begin or cease to turn: transfer numbers, times, whether they turn from then on."""

    number: Array
    t: Array
    turning: Array


class _Told(NamedTuple):
    """Rows of a unit, or of commands of a bus: which are `on`, and the places of those that differ from the last."""

    unit: ReportingEsc
    table: DecodedTable
    rows: Array
    on: Array
    changed: Array


_known: WeakKeyDictionary[View, list[_Told]] = WeakKeyDictionary()


def _told(view: View) -> list[_Told]:
    """Return what a batch tells of motors; several rules ask."""
    if view not in _known:
        _known[view] = [_Told(unit, table, rows, on, changes(on, on[0])) for unit, table, rows, on in _states(view)]
    return _known[view]


def _states(view: View) -> Iterator[tuple[ReportingEsc, DecodedTable, Array, Array]]:
    table = view.table("ESCStatus")
    if table is not None:
        yield from ((unit, table, rows, table["rpm"][rows] != 0) for unit, rows in units(view).items())
    for bus, sent in commands(view).items():
        yield ReportingEsc(bus, COMMANDS, 0), sent.table, sent.rows, np.any(sent.cmd > 0, axis=0)


class Motion:
    """Follows whether motors turn: a throttle is above 0, or an ESC has a speed. The first `MOST_UNITS` count."""

    def __init__(self) -> None:
        self._on: dict[ReportingEsc, bool] = {}
        self._turning: dict[int, int] = {}  # units that are on, by bus

    def known(self, bus: int) -> bool:
        """Return whether anything is known of a bus."""
        return bus in self._turning

    def turning(self, bus: int) -> bool:
        """Return whether motors turn on a bus by now."""
        return self._turning.get(bus, 0) > 0

    def feed(self, view: View) -> dict[int, Changes]:
        """Add the next batch; return its changes by bus."""
        steps: dict[int, list[tuple[Array, Array, Array]]] = {}
        for told in _told(view):
            self._note(view, steps, told)
        return {bus: self._changes(bus, parts) for bus, parts in steps.items()}

    def _note(
        self, view: View, steps: dict[int, list[tuple[Array, Array, Array]]], told: _Told
    ) -> None:  # fmt: skip
        unit, table, every, on, changed = told
        if unit not in self._on and len(self._on) >= MOST_UNITS:
            return
        self._turning.setdefault(unit.bus, 0)
        at = changed if self._on.get(unit, False) == on[0] else np.append(0, changed)
        self._on[unit] = bool(on[-1])
        if len(at):
            rows = every[at]
            step = np.where(on[at], 1, -1)
            number = table["transfer"][rows].astype(np.int64)
            steps.setdefault(unit.bus, []).append((number, end(view, table, rows), step))

    def _changes(self, bus: int, parts: list[tuple[Array, Array, Array]]) -> Changes:
        number, t, step = (np.concatenate(part) for part in zip(*parts, strict=True))
        order = np.argsort(number, kind="stable")
        count = self._turning[bus] + np.cumsum(step[order])
        on = count > 0
        at = changes(on, self._turning[bus] > 0)
        self._turning[bus] = int(count[-1])
        return Changes(number[order][at], t[order][at], on[at])
