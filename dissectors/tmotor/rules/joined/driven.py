"""Drives of a motor beside RawCommand: control packets 0x06 (4.4.4 table 4), or PWM that has priority (4.2)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from dissectors.kit import Array, groups, sound, usable
from dissectors.tmotor.rules.joined.joins import MOST_UNITS
from dissectors.tmotor.rules.packets.carried import ALL_UNITS, FIRST_UNIT

if TYPE_CHECKING:
    from dissectors.kit import DecodedTable, View

_RELEASED = (0x00, 0x66)  # control modes that drive nothing
PWM, CAN = 0, 1  # throttle priorities (4.2)
_Told = Mapping[tuple[int, int], tuple[Array, Array]]  # of switches: transfers, and whether they turned it on
_NOTHING: _Told = {}


class _Switches:
    """Switches by bus and a number, as they stand at any transfer of the batch that was fed last; all begin off."""

    def __init__(self) -> None:
        self._before: dict[tuple[int, int], bool] = {}
        self._now = _NOTHING

    def feed(self, now: _Told) -> None:
        """Add a batch: by which transfers, in order, each one was turned on or off."""
        for place, (_, states) in self._now.items():
            if place in self._before or len(self._before) < MOST_UNITS:
                self._before[place] = bool(states[-1])
        self._now = now

    def off(self, bus: int, which: int) -> bool:
        """Return whether one is off at any transfer."""
        return (bus, which) not in self._now and not self._before.get((bus, which))

    def at(self, bus: int, which: int, number: Array) -> Array:
        """Return how one stands at some transfers."""
        before = self._before.get((bus, which), False)
        if (bus, which) not in self._now:
            return np.full(len(number), before)
        at, states = self._now[bus, which]
        found: Array = np.append(before, states)[np.searchsorted(at, number)]
        return found


def _told(bus: Array, which: Array, number: Array, on: Array) -> _Told:
    """Return by which transfers, in order, each switch was turned on or off."""
    keys = bus.astype(np.int64) << 16 | which
    return {(key >> 16, key & 0xFFFF): (number[at], on[at]) for key, at in groups(keys)}


def _driven(table: DecodedTable) -> _Told:
    """Return when units were driven; several rules ask."""
    rows = sound(table).nonzero()[0]
    mode = table["control_mode"][rows]
    driven = (mode != _RELEASED[0]) & (mode != _RELEASED[1])
    return _told(table.bus[rows], table["unit_id"][rows], table["transfer"][rows].astype(np.int64), driven)


class DrivenUnits:
    """Units that the last control packet drives."""

    def __init__(self) -> None:
        self._units = _Switches()

    def feed(self, view: View) -> None:
        """Add the next batch."""
        table = view.table("PUSHSCI.OutputControl")
        self._units.feed(_NOTHING if table is None else table.once(_driven))

    def never(self, bus: int, index: int) -> bool:
        """Return whether the unit of an ESC index is driven at no transfer."""
        return self._units.off(bus, FIRST_UNIT + index) and self._units.off(bus, ALL_UNITS)

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


_known: WeakKeyDictionary[View, list[Priority]] = WeakKeyDictionary()


def priorities(view: View) -> list[Priority]:
    """Return what ParamGet (4.4.6) and the FOC feedback (4.4.5) of a batch tell, in the order of transfers."""
    if view not in _known:
        _known[view] = _priorities(view)
    return _known[view]


def _priorities(view: View) -> list[Priority]:
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


_pwm: WeakKeyDictionary[View, _Told] = WeakKeyDictionary()


def _prefers_pwm(view: View) -> _Told:
    """Return when nodes of a batch said that PWM goes before CAN, or that it does not; several rules ask."""
    if view not in _pwm:
        said = priorities(view)
        transfer, bus, node, priority, _ = np.array(said, np.int64).reshape(-1, len(Priority._fields)).T
        _pwm[view] = _told(bus, node, transfer, priority == PWM) if said else _NOTHING
    return _pwm[view]


class PwmPriority:
    """Nodes that say that PWM goes before CAN."""

    def __init__(self) -> None:
        self._nodes = _Switches()

    def feed(self, view: View) -> None:
        """Add the next batch."""
        self._nodes.feed(_prefers_pwm(view))

    def never(self, bus: int, node: int) -> bool:
        """Return whether PWM has priority in a node at no transfer."""
        return self._nodes.off(bus, node)

    def at(self, bus: int, node: int, number: Array) -> Array:
        """Return a mask of the transfers at which PWM has priority in a node."""
        return self._nodes.at(bus, node, number)
