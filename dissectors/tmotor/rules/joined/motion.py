"""Motors that turn or rest."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dissectors.kit import changes
from dissectors.tmotor.rules.joined.joins import MOST_UNITS, ReportingEsc, commands, end, units

if TYPE_CHECKING:
    from dissectors.kit import Array, DecodedTable, View

COMMANDS = -1  # in place of a node: the throttle on a bus


class Changes(NamedTuple):
    """Where motors of a bus begin or cease to turn: transfer numbers, times, whether they turn from then on."""

    number: Array
    t: Array
    turning: Array


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
        table = view.table("ESCStatus")
        if table is not None:
            for unit, rows in units(view).items():
                self._note(view, steps, unit, (table, rows), table["rpm"][rows] != 0)
        for bus, sent in commands(view).items():
            on: Array = np.any(sent.cmd > 0, axis=0)
            self._note(view, steps, ReportingEsc(bus, COMMANDS, 0), (sent.table, sent.rows), on)
        return {bus: self._changes(bus, parts) for bus, parts in steps.items()}

    def _note(
        self, view: View, steps: dict[int, list[tuple[Array, Array, Array]]], unit: ReportingEsc,
        where: tuple[DecodedTable, Array], on: Array,
    ) -> None:  # fmt: skip
        if unit not in self._on and len(self._on) >= MOST_UNITS:
            return
        self._turning.setdefault(unit.bus, 0)
        at = changes(on, self._on.get(unit, False))
        self._on[unit] = bool(on[-1])
        if len(at):
            table, rows = where[0], where[1][at]
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
