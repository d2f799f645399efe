"""Faults that an ESC reports of itself: TYP-305 and TYP-306."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dissectors.times import MILLISECOND, SECOND
from dissectors.tmotor.traffic.faults.occasions import chosen, once, span
from dissectors.tmotor.traffic.faults.status import status_of
from dissectors.tmotor.traffic.operation import ERROR
from dissectors.tmotor.traffic.physics.motor import HEAT_CAPACITY
from dissectors.traffic import Fault

if TYPE_CHECKING:
    from dissectors.traffic import Case, Sending

_MOS_OVER_TEMPERATURE, _STALL = 5, 7
# How far (K) the heating goes beyond the limit, and what the air takes away meanwhile (W/K).
_BEYOND, _AIR = 8.0, 0.5
# No longer than this share of what is left of the flight, so that the limit is passed in time.
_SHARE = 0.6
_STEP = 20 * MILLISECOND
# How long a blocked rotor is driven before the ESC gives up.
_TRIES = 150 * MILLISECOND


def _bit(case: Case) -> None:
    """Raise a fault bit; over-temperature comes from heat, the others are set."""
    esc, bit = chosen(case), int(case.options["bit"])
    mask = 1 << bit
    if esc.faults & mask:  # it cannot rise
        return
    shown = status_of(esc.node.number)

    def shows(sending: Sending) -> bool:
        return shown(sending) and bool(sending.values["error_count"] & mask)

    if bit == _MOS_OVER_TEMPERATURE:
        case.watch(shows)
        _heat(case, esc)
        return
    over = case.world.now + span(case)
    case.watch(shows, over + SECOND)
    esc.fault_bits |= mask
    case.say(f"status bit {bit} of the ESC with index {esc.index} set for {float(case.options['seconds']):g} s")

    def fall() -> None:
        esc.fault_bits &= ~mask

    case.world.at(over, fall)


def _heat(case: Case, esc: Any) -> None:
    """Heat the ESC past its limit by a short circuit within the settings' seconds; from then on it cools down."""
    world, motor = case.world, esc.motor
    left = _SHARE * (world.end - world.now) / SECOND
    seconds = max(0.1, min(float(case.options["seconds"]), left))
    limit, before = esc.parameters["esc_ot_threshold"], motor.temperature
    rise = max(_BEYOND, limit + _BEYOND - before)
    watts = round(rise * (HEAT_CAPACITY / seconds + _AIR))
    esc.heat += watts
    case.say(
        f"{watts} W of loss heat the ESC with index {esc.index} from {before:.1f} degC past its limit of {limit} degC "
        f"within {seconds:.1f} s; status bit {_MOS_OVER_TEMPERATURE} rises then"
    )

    def cool() -> None:
        esc.heat -= watts

    once(case, lambda: motor.temperature >= limit + _BEYOND, cool, _STEP)


def _error(case: Case) -> None:
    """Block the rotor: the ESC gives up, and starts again once it is free."""
    esc, world = chosen(case), case.world
    shown, free_at = status_of(esc.node.number), world.now + _TRIES + span(case)
    if esc.mode is not None or esc.motor.blocked:  # it has failed already
        return
    stall = 1 << _STALL
    case.watch(lambda sending: shown(sending) and sending.values["error_count"] >> 12 & 15 == ERROR, free_at + SECOND)
    case.say(
        f"the rotor of the ESC with index {esc.index} blocks: stall (bit {_STALL}), "
        f"after {_TRIES // MILLISECOND} ms error mode for {float(case.options['seconds']):g} s"
    )
    esc.motor.blocked = True

    def give_up() -> None:
        esc.mode = ERROR
        esc.fault_bits |= stall

    def free() -> None:
        esc.motor.blocked, esc.mode = False, None
        esc.fault_bits &= ~stall

    world.at(world.now + _TRIES, give_up)
    world.at(free_at, free)


FAULTS: tuple[Fault, ...] = (
    Fault(
        "TYP-305",
        "a fault bit of an ESC rises: it gets too hot",
        start=_bit,
        options={"bit": _MOS_OVER_TEMPERATURE, "seconds": 3.0},
        limits={"bit": (0, 11)},
        lasts=SECOND,
        also=("PUSH-410",),
    ),
    Fault(
        "TYP-306",
        "an ESC goes into error mode",
        start=_error,
        options={"seconds": 0.8},
        lasts=SECOND,
        also=("TYP-305", "PUSH-401", "PUSH-410", "BUS-028"),
    ),
)
