"""ESCs that do not do what a control packet asks of them (4.4.4 table 4): PUSH-306 and PUSH-307.

The channel of the ESC is at zero throttle meanwhile, and its motor stands before it is asked for anything.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dissectors.times import MILLISECOND, SECOND
from dissectors.tmotor.traffic.control import (
    CURRENT,
    LIMITS,
    LOCK,
    POSITION,
    QUERY,
    REVERSE_CURRENT,
    REVERSE_POSITION,
    REVERSE_SPEED,
    SPEED,
)
from dissectors.tmotor.traffic.faults.carried import able, carried
from dissectors.tmotor.traffic.faults.occasions import once, put
from dissectors.tmotor.traffic.packets import change
from dissectors.traffic import Fault, Step

if TYPE_CHECKING:
    from dissectors.traffic import Case, Sending

# The least set point, raw, of which a motor that stands falls short by more than a sensor errs.
_FAR = {SPEED: 300, REVERSE_SPEED: 300, CURRENT: 500, REVERSE_CURRENT: 500, POSITION: 0, REVERSE_POSITION: 0}
_APART = 15.0  # degrees between a position that is asked for and where the rotor stands
# How long everybody has known that the motor stands; how often, and how long, it is asked.
_SHOWN, _EVERY, _TIMES = 500 * MILLISECOND, 400 * MILLISECOND, 13
_STEP = 50 * MILLISECOND
# A motor takes about 2 s to run out.
_LASTS = 2 * SECOND + _SHOWN + _EVERY * _TIMES


def _ignored(case: Case) -> None:
    """Have a motor driven without throttle whose ESC stays where it is."""
    mode, value, esc = int(case.options["mode"]), int(case.options["value"]), able(case)
    if esc is None or not _FAR.get(mode, LIMITS[SPEED] + 1) <= value <= LIMITS[mode]:
        return

    def begin() -> None:
        if mode in (POSITION, REVERSE_POSITION) and not _away(esc.motor.position, value / 10):
            return
        esc.obeys = False
        _ask(case, esc, mode, value)
        case.say(f"unit 0x{esc.unit:02X} is asked for {value} in control mode 0x{mode:02X}, and stands")

    _rest(case, esc, begin)


def _away(position: float, wanted: float) -> bool:
    """Return if a rotor stands far from a position and from its mirror, which some modes allow."""
    return all(abs((position - end + 180) % 360 - 180) > _APART for end in (wanted, -wanted))


def _unheld(case: Case) -> None:
    """Have a rotor locked that is not held: the ESC never says that it is, or it says so and wind turns it."""
    esc, slips = able(case), str(case.options["how"]) == "slips"
    if esc is None:
        return

    def begin() -> None:
        esc.obeys = slips
        _ask(case, esc, LOCK, 0)
        if slips:
            case.world.at(case.world.now + _EVERY, slip)
        told = f"slips by {float(case.options['speed']):g} degrees a second" if slips else "does not lock"
        case.say(f"the rotor of unit 0x{esc.unit:02X} is to be locked, and {told}")

    def slip() -> None:
        turned = float(case.options["speed"]) * _STEP / SECOND
        esc.motor.angle = (esc.motor.angle + turned) % 360
        esc.motor.set_point += turned
        if esc.control.locked:
            case.world.at(case.world.now + _STEP, slip)

    _rest(case, esc, begin)


def _rest(case: Case, esc: Any, begin: Any) -> None:
    """Keep the throttle of an ESC at zero, and begin once its motor stands."""
    pilot = case.vehicle.pilot
    before = pilot.hook

    def rests(commands: list[int]) -> list[int]:
        return [0 if index == esc.index else one for index, one in enumerate(commands)]

    def back() -> None:
        pilot.hook = before
        esc.obeys = True

    def stands() -> None:
        case.world.at(case.world.now + _SHOWN, begin)
        case.world.at(case.world.now + _SHOWN + _EVERY * _TIMES, back)

    pilot.hook = rests
    once(case, lambda: not case.vehicle.command(esc.index) and not esc.motor.speed, stands)


def _ask(case: Case, esc: Any, mode: int, value: int) -> None:
    """Send a control packet again and again, then release.

    What the ground station has sent to control the unit in between says the same.
    """
    world, vehicle = case.world, case.vehicle
    until = world.now + _EVERY * _TIMES
    case.answer.node, case.answer.type = esc.node.number, "PUSHCAN"

    def repeat(case: Case, sending: Sending) -> Step:
        if sending.t >= until:
            return Step.DONE
        found = carried(sending)
        if found is None or sending.changed or found[0] != "OutputControl" or found[1]["unit_id"] != esc.unit:
            return Step.MORE
        put(sending, "data", change(bytes(sending.values["data"]), control_mode=mode, set_point=value))
        case.mark(sending)
        return Step.MORE

    def again() -> None:
        if world.now < until:
            vehicle.push("OutputControl", esc.unit, control_mode=mode, set_point=value)
            world.at(world.now + _EVERY, again)
        else:
            vehicle.push("OutputControl", esc.unit, control_mode=QUERY)

    def shows(sending: Sending) -> bool:
        found = carried(sending)
        return found is not None and (found[0], sending.node) == ("MotorStatus", esc.node.number)

    case.touch("values", repeat)
    case.watch(shows, until)
    again()


FAULTS: tuple[Fault, ...] = (
    Fault(
        "PUSH-306",
        "an ESC does not follow a set point",
        start=_ignored,
        options={"mode": SPEED, "value": 2000},
        lasts=_LASTS,
    ),
    Fault(
        "PUSH-307",
        "a rotor that is to be locked is not held",
        start=_unheld,
        options={"how": "ignored", "speed": 40.0},
        choices={"how": ("ignored", "slips")},
        limits={"speed": (15, 180)},
        lasts=_LASTS,
    ),
)
