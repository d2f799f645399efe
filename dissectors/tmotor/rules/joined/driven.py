"""Drives of a motor beside RawCommand: control packets 0x06 (4.4.4 table 4), or PWM that has priority (4.2)."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dissectors.kit import sound, usable
from dissectors.tmotor.rules.joined.joins import MOST_UNITS
from dissectors.tmotor.rules.packets.carried import ALL_UNITS, FIRST_UNIT

if TYPE_CHECKING:
    from dissectors.kit import Array, View

_RELEASED = (0x00, 0x66)  # control modes that drive nothing
PWM, CAN = 0, 1  # throttle priorities (4.2)


class _Switches:
    """Switches by bus and a number, as they stand at any transfer of the batch that was fed last; all begin off."""

    def __init__(self) -> None:
        self._before: dict[tuple[int, int], bool] = {}
        self._now: dict[tuple[int, int], list[tuple[int, bool]]] = {}

    def next(self) -> None:
        """Begin a batch."""
        for place, said in self._now.items():
            if place in self._before or len(self._before) < MOST_UNITS:
                self._before[place] = said[-1][1]
        self._now = {}

    def turn(self, bus: int, which: int, number: int, *, on: bool) -> None:
        """Turn one on or off with a transfer; those of a batch come in order."""
        self._now.setdefault((bus, which), []).append((number, on))

    def at(self, bus: int, which: int, number: Array) -> Array:
        """Return how one stands at some transfers."""
        place = (bus, which)
        said = self._now.get(place, [])
        states = np.array([self._before.get(place, False), *(one for _, one in said)])
        found: Array = states[np.searchsorted(np.array([at for at, _ in said], np.int64), number)]
        return found


class DrivenUnits:
    """Units that the last control packet drives."""

    def __init__(self) -> None:
        self._units = _Switches()

    def feed(self, view: View) -> None:
        """Add the next batch."""
        self._units.next()
        table = view.table("PUSHSCI.OutputControl")
        if table is not None:
            for row in np.flatnonzero(sound(table)).tolist():
                driven = int(table["control_mode"][row]) not in _RELEASED
                self._units.turn(
                    int(table.bus[row]), int(table["unit_id"][row]), int(table["transfer"][row]), on=driven
                )

    def at(self, bus: int, index: int, number: Array) -> Array:
        """Return a mask of the transfers at which the unit of an ESC index is driven."""
        alone, all_units = (self._units.at(bus, unit, number) for unit in (FIRST_UNIT + index, ALL_UNITS))
        mask: Array = alone | all_units
        return mask


class Priority(NamedTuple):
    """The throttle priority that a node told of itself: 0 is PWM, 1 is CAN."""

    transfer: int
    bus: int
    node: int
    priority: int
    t: int


def priorities(view: View) -> list[Priority]:
    """Return what ParamGet (4.4.6) and the FOC feedback (4.4.5) of a batch tell, in the order of transfers."""
    said: list[Priority] = []
    for name, column, good in (
        ("ParamGet", "esc_signal_priority", usable), ("PUSHCAN.FocFeedback", "throttle_priority", sound),
    ):  # fmt: skip
        table = view.table(name)
        if table is not None:
            rows = np.flatnonzero(good(table))
            parts = (table["transfer"], table.bus, table.src, table[column], table.t)
            said += map(Priority._make, zip(*(part[rows].tolist() for part in parts), strict=True))
    return sorted(said)


class PwmPriority:
    """Nodes that say that PWM goes before CAN."""

    def __init__(self) -> None:
        self._nodes = _Switches()

    def feed(self, view: View) -> None:
        """Add the next batch."""
        self._nodes.next()
        for said in priorities(view):
            self._nodes.turn(said.bus, said.node, said.transfer, on=said.priority == PWM)

    def at(self, bus: int, node: int, number: Array) -> Array:
        """Return a mask of the transfers at which PWM has priority in a node."""
        return self._nodes.at(bus, node, number)
