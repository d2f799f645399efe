"""Habits of an ESC's packets throughout a capture: PUSH-010 and PUSH-011."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dissectors.tmotor.traffic.faults.carried import able
from dissectors.tmotor.traffic.motor_controller import UNITS
from dissectors.traffic import Fault

if TYPE_CHECKING:
    from dissectors.traffic import Case

# What the same bytes seem to say to somebody who reads them little-endian.
_MISREAD = (
    *("PUSH-103", "PUSH-402", "PUSH-403", "PUSH-405", "PUSH-407", "PUSH-408", "PUSH-409", "PUSH-502", "BUS-032"),
)


def _watch(case: Case, *nodes: int) -> None:
    case.watch(lambda sending: sending.name == "PUSHCAN" and sending.node in nodes)


def _big_endian(case: Case) -> None:
    esc = able(case)
    if esc is None:
        return
    esc.big_endian = True
    _watch(case, esc.node.number)
    case.say(f"node {esc.node.number} sends the high byte of every 16-bit number in its packets first")


def _mapping(case: Case) -> None:
    """Give two ESCs each other's unit; a single one gets that of another place."""
    esc = able(case)
    if esc is None:
        return
    others: list[Any] = [other for other in case.vehicle.escs if other is not esc and other.unit is not None]
    if others:
        other = case.random.choice(others)
        esc.unit, other.unit = other.unit, esc.unit
        swapped = [esc, other]
    else:
        esc.unit = UNITS[(UNITS.index(esc.unit) + 1) % len(UNITS)]
        case.vehicle.units[:] = [esc.unit]
        swapped = [esc]
    _watch(case, *(one.node.number for one in swapped))
    case.say(
        " and ".join(f"node {one.node.number}, esc_index {one.index}, sends unit 0x{one.unit:02X}" for one in swapped)
    )


FAULTS: tuple[Fault, ...] = (
    Fault("PUSH-010", "an ESC whose packets are big-endian", start=_big_endian, early=True, also=_MISREAD),
    Fault("PUSH-011", "ESCs whose power units are not in the order of their indexes", start=_mapping, early=True),
)
