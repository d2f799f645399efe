"""Faults of packets that the ground station sends (4.4.4): PUSH-006, -101, -102, -201, -301 to -305, and BUS-044.

It sends one more than it would, at the time of the fault, to a motor that turns: an ESC takes no control mode then, and
no value out of range ever.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dissectors.times import MILLISECOND, SECOND
from dissectors.tmotor.traffic.control import FREE, LIMITS, LOCK, QUERY, SPEED
from dissectors.tmotor.traffic.faults.carried import (
    COMPARED,
    UNSAID,
    able,
    asked,
    carried,
    description,
    forbidden,
    who,
)
from dissectors.tmotor.traffic.faults.occasions import once
from dissectors.tmotor.traffic.packets import EVERY_UNIT
from dissectors.traffic import Fault

if TYPE_CHECKING:
    from dissectors.traffic import Case, Sending, Start

_FOC = ("FocParameters", "FocQuery")
# FOC parameters with a range, and the first value behind it.
_BEYOND = {"throttle_priority": 2, "position_loop": 2, "bus_rate": 6, "report_rate": 401, "save_option": 2}
# What an ESC should not be asked while its motor turns: packet and values.
_AT_REST: dict[str, tuple[str, dict[str, int]]] = {
    "lock": ("OutputControl", {"control_mode": LOCK}),
    "free": ("OutputControl", {"control_mode": FREE}),
    "zero": ("SetZero", {}),
    "foc": ("FocParameters", {"acceleration_limit": 300}),
}
_TURNING = 300  # rpm, well above what counts as standing
_FOR_EVER = 1 << 62
# How long an answer stays away: the rule's limit, and what the command needs to get through.
_FEEDBACK, _STATUS = 1100 * MILLISECOND, 230 * MILLISECOND


def _push(case: Case, name: str, told: str, **values: int) -> None:
    """Send a packet to the ESC that is chosen; `told` is about what is wrong with it."""
    esc = able(case)
    if esc is not None:
        _send(case, esc, name, told, **values)


def _send(case: Case, esc: Any, name: str, told: str, **values: int) -> None:
    sending = case.vehicle.push(name, esc.unit, **values)
    case.mark(sending)
    found = carried(sending)
    case.say(told if found is None else f"{who(*found)}: {told}")


def _range(case: Case) -> None:
    """Sum the range that the document prints: it leaves two bytes out, whose sum is no multiple of 256 here."""
    told = "the checksum is the sum of bytes 1 to 28, not 1 to 30"
    _push(case, "FocParameters", told, sum_end=28, save_option=0)


def _out_of_range(case: Case) -> None:
    wanted = asked(case, _BEYOND)
    if wanted is None:
        return
    field, value = wanted
    place, raw = field, value
    if field == "position_loop":  # byte 24, behind the throttle priority in byte 23
        place, raw = "throttle_priority", value << 8 | 1
    if not forbidden(description(case, "PUSHSCI", "FocParameters"), place, raw):
        return
    if field in COMPARED:
        case.answer.also = ("PUSH-103", *case.answer.also)
    _push(case, "FocParameters", f"{field} is {value}", **{place: raw})


def _unknown_mode(case: Case) -> None:
    mode = int(case.options["value"])
    if forbidden(description(case, "PUSHSCI", "OutputControl"), "control_mode", mode):
        _push(case, "OutputControl", f"control_mode is 0x{mode:02X}", control_mode=mode)


def _set_point(case: Case) -> None:
    mode, value = int(case.options["mode"]), int(case.options["value"])
    if LIMITS.get(mode, 0xFFFF) < value <= 0xFFFF:
        told = f"set_point is {value} in control mode 0x{mode:02X}"
        _push(case, "OutputControl", told, control_mode=mode, set_point=value)


def _reserved(case: Case) -> None:
    value = int(case.options["value"])
    if forbidden(description(case, "PUSHSCI", "OutputControl"), "reserved", value):
        told = f"the reserved bytes 10 and 11 hold {value}"
        _push(case, "OutputControl", told, control_mode=QUERY, reserved=value)


def _unanswered(name: str, answer: str, away: int, *commands: str, **values: int) -> Start:
    """Let the ESC do as it is told, but for so many ns send no packet that would be the answer.

    What else the ground station wants to know in the meantime is part of it.
    """

    def start(case: Case) -> None:
        esc = able(case)
        if esc is None:
            return
        until = case.world.now + away
        esc.reports.hush(answer, until)
        case.watch(lambda sending: _asks(sending, esc.unit, commands), until)
        told = f"node {esc.node.number} sends no {answer} for {away // MILLISECOND} ms from now"
        _send(case, esc, name, told, **values)

    return start


def _deaf(case: Case) -> None:
    """Let no ESC ever answer a query, and the ground station ask again and again."""
    esc, world = able(case), case.world
    if esc is None:
        return
    times = max(3, round(float(case.options["seconds"])))
    for one in case.vehicle.escs:
        one.reports.hush("FocFeedback", _FOR_EVER)

    def ask(turn: int) -> None:
        case.mark(case.vehicle.push("FocQuery", EVERY_UNIT))
        if turn + 1 < times:
            world.at(world.now + SECOND, lambda: ask(turn + 1))

    case.say(f"no ESC ever sends FocFeedback, and all units are asked for it {times} times")
    world.at(world.now + SECOND, lambda: ask(0))


def _asks(sending: Sending, unit: int, commands: tuple[str, ...]) -> bool:
    found = carried(sending)
    return found is not None and found[0] in commands and found[1]["unit_id"] in {unit, EVERY_UNIT}


def _interlock(case: Case) -> None:
    """Send what is only for motors at rest once the motor of the ESC that is chosen turns."""
    esc = able(case)
    if esc is None:
        return
    name, values = _AT_REST[str(case.options["what"])]

    def send() -> None:
        _send(case, esc, name, f"its motor turns at {esc.motor.rpm:.0f} rpm", **values)

    once(case, lambda: case.vehicle.command(esc.index) > 0 and abs(esc.motor.rpm) > _TURNING, send)


FAULTS: tuple[Fault, ...] = (
    Fault(
        "BUS-044",
        "queries that no ESC ever answers",
        start=_deaf,
        early=True,
        options={"seconds": 6.0},
        limits={"seconds": (5, 60)},
        also=("PUSH-102", "PUSH-201"),
        lasts=8 * SECOND,
    ),
    Fault("PUSH-006", "a checksum over bytes 1 to 28 of FocParameters", start=_range, also=("PUSH-305",)),
    Fault(
        "PUSH-101",
        "a FOC parameter out of range",
        start=_out_of_range,
        options={"field": "save_option", "value": UNSAID},
        also=("PUSH-305",),
    ),
    Fault(
        "PUSH-102",
        "FOC parameters are set, and nothing is fed back",
        start=_unanswered("FocParameters", "FocFeedback", _FEEDBACK, *_FOC, save_option=0),
        also=("PUSH-201", "PUSH-305"),
        lasts=5 * SECOND // 4,
    ),
    Fault(
        "PUSH-201",
        "FOC parameters are asked for, and nothing is fed back",
        start=_unanswered("FocQuery", "FocFeedback", _FEEDBACK, *_FOC),
        also=("PUSH-102",),
        lasts=5 * SECOND // 4,
    ),
    Fault("PUSH-301", "an unknown control mode", start=_unknown_mode, options={"value": 0x77}),
    Fault(
        "PUSH-302",
        "a set point out of the range of its control mode",
        start=_set_point,
        options={"mode": SPEED, "value": 12_000},
    ),
    Fault("PUSH-303", "reserved bytes that are not zero", start=_reserved, options={"value": 1}),
    Fault(
        "PUSH-304",
        "a control packet, and no status follows",
        start=_unanswered("OutputControl", "MotorStatus", _STATUS, "OutputControl", control_mode=QUERY),
        lasts=SECOND // 2,
    ),
    Fault(
        "PUSH-305",
        "the ground station asks for what is only for motors at rest while one turns: what=",
        start=_interlock,
        options={"what": "lock"},
        choices={"what": tuple(_AT_REST)},
        lasts=SECOND // 2,
    ),
)
