"""Faults between throttle commands and motors: BUS-006, -007, -016, -023, -026 to -028, -038, -040 and -043."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dissectors.times import MILLISECOND, SECOND
from dissectors.tmotor.traffic.faults.carried import able, carries
from dissectors.tmotor.traffic.faults.occasions import chosen, misreport, once, put, span, unsent
from dissectors.tmotor.traffic.faults.status import STATUS, status_of
from dissectors.tmotor.traffic.packets import change
from dissectors.tmotor.traffic.throttle import TIMEOUT
from dissectors.traffic import Fault, Step

if TYPE_CHECKING:
    from collections.abc import Callable

    from dissectors.traffic import Case, Sending

_COMMAND = "RawCommand"
_ABNORMAL = 4
_TURN = 50 * MILLISECOND
_SECOND_SOURCE = 99
_DRIVEN = 1000  # a throttle at which a motor turns
_NO_THROTTLE = 10_400  # 0.1 us: the width of throttle 0 of a UAV (4.4.1 explanation 5)
_STILL = 2 * SECOND - 20 * MILLISECOND  # so long after the last command a motor must not turn any more
_FOR_EVER = 1 << 62


def _slow(case: Case) -> None:
    """Leave out every other command for the whole flight: 200 Hz."""
    pilot, turn = case.vehicle.autopilot.number, [0]

    def thin(case: Case, sending: Sending) -> Step:
        if sending.name != _COMMAND or sending.node != pilot or sending.changed:
            return Step.MORE
        turn[0] += 1
        if turn[0] % 2:
            case.mark(sending)
            return Step.MORE
        unsent(case.vehicle.autopilot, sending)
        return Step.MORE

    case.say("the autopilot commands at half its rate")
    case.touch("frames", thin)


def _stop(case: Case) -> None:
    """Stop the commands once motors are to turn."""
    vehicle, world = case.vehicle, case.world

    def begin() -> None:
        until = world.now + span(case)
        vehicle.commanding = False
        case.watch(lambda sending: STATUS(sending) and sending.t > until - 50 * MILLISECOND, until + 50 * MILLISECOND)
        case.say(f"no RawCommand for {float(case.options['seconds']):g} s")
        world.at(until, go_on)

    def go_on() -> None:
        vehicle.commanding = True

    once(case, lambda: any(vehicle.pilot.last) and vehicle.commanding, begin)


def _run_on(case: Case) -> None:
    """Stop the commands; one ESC never stops to hold its last throttle (4.4.1 explanation 2)."""
    esc, vehicle, world = chosen(case), case.vehicle, case.world
    shown = status_of(esc.node.number)

    def begin() -> None:
        since, until = world.now, world.now + span(case)
        vehicle.commanding, esc.throttle.timeout = False, _FOR_EVER
        case.watch(lambda sending: shown(sending) and since + _STILL <= sending.t < until, until)
        case.say(
            f"no RawCommand for {float(case.options['seconds']):g} s; the ESC with index {esc.index} holds "
            f"{vehicle.command(esc.index)} all the time"
        )
        world.at(until, go_on)

    def go_on() -> None:
        vehicle.commanding, esc.throttle.timeout = True, TIMEOUT

    once(case, lambda: vehicle.command(esc.index) > _DRIVEN and vehicle.commanding, begin)


def negative(index: int) -> Callable[[list[int]], list[int]]:
    """Return a hook that gives one channel a negative throttle."""
    return lambda commands: [-600 if k == index else value for k, value in enumerate(commands)]


def hook(case: Case, change: Callable[[list[int]], list[int]], until: int) -> None:
    """Change all throttles up to a time."""
    vehicle = case.vehicle
    before, vehicle.throttle_hook = vehicle.throttle_hook, change

    def back() -> None:
        vehicle.throttle_hook = before

    case.world.at(until, back)


def _silent_about_it(case: Case) -> None:
    """Send a negative throttle that its ESC should report as abnormal (4.4.1 explanation 2), and does not."""
    esc, until = chosen(case), case.world.now + span(case)
    shown, index = status_of(esc.node.number), esc.index

    def hide(_: Case, sending: Sending) -> Step:
        if sending.t > until + 200 * MILLISECOND:
            return Step.DONE
        if shown(sending) and not sending.changed:
            put(sending, "error_count", sending.values["error_count"] & ~(1 << _ABNORMAL))
        return Step.MORE

    hook(case, negative(index), until)
    case.touch("values", hide)

    def negated(sending: Sending) -> bool:
        return sending.name == _COMMAND and any(one < 0 for one in sending.values["cmd"][index : index + 1])

    case.watch(negated, until + SECOND)
    case.say(f"throttle -600 for the ESC with index {index}, which never sets bit 4")


def _second(case: Case) -> None:
    """Let a test tool command, too; its throttles are zero."""
    tool = case.world.device(_SECOND_SOURCE, "org.example.tool")
    tool.silent = False
    times = max(2, round(float(case.options["seconds"]) * 20))
    channels = len(case.vehicle.escs)

    def command(turn: int) -> None:
        sending = tool.send(_COMMAND, {"cmd": [0] * channels})
        sending.damaged = True
        case.mark(sending)
        if turn + 1 < times:
            case.world.at(case.world.now + _TURN, lambda: command(turn + 1))

    case.say(f"node {_SECOND_SOURCE} sends RawCommand, too, {times} times")
    command(0)


def _channels(more: int, say: str) -> Fault:
    rule = "BUS-026" if more < 0 else "BUS-027"

    def start(case: Case) -> None:
        until, usual = case.world.now + span(case), len(case.vehicle.escs)
        if usual + more < 1:
            return

        def change(commands: list[int]) -> list[int]:
            return [*commands, *[0] * more] if more > 0 else commands[:more]

        hook(case, change, until)
        case.watch(lambda sending: sending.name == _COMMAND and len(sending.values["cmd"]) != usual, until + SECOND)
        case.say(f"RawCommand has {usual + more} channels for {usual} ESCs")

    return Fault(
        rule, say, start=start, options={"seconds": 2.5}, limits={"seconds": (1.5, 3600)}, lasts=2600 * MILLISECOND,
        also=("TYP-103", "BUS-017", "BUS-028", "TYP-305", "PUSH-410"),
    )  # fmt: skip


def _stuck(case: Case) -> None:
    """Block a motor although it is commanded all the time; its ESC says nothing about it."""
    esc = chosen(case)
    shown = status_of(esc.node.number)

    def driven(commands: list[int]) -> list[int]:
        return [max(one, _DRIVEN) if index == esc.index else one for index, one in enumerate(commands)]

    def begin() -> None:
        hook(case, driven, case.world.now + span(case))
        case.say(f"the ESC with index {esc.index} reports 0 rpm at throttle {case.vehicle.command(esc.index)}")
        misreport(case, shown, "rpm", 0, case.world.now + span(case))

    once(case, lambda: case.vehicle.command(esc.index) > _DRIVEN, begin)


def _less(case: Case) -> None:
    """Let an ESC report some throttle that it is not commanded, without a word about why."""
    esc = chosen(case)
    shown, percent = status_of(esc.node.number), int(case.options["percent"])

    def begin() -> None:
        misreport(case, shown, "power_rating_pct", percent, case.world.now + span(case))
        case.say(f"the ESC with index {esc.index} reports {percent} % at throttle {case.vehicle.command(esc.index)}")

    once(case, lambda: case.vehicle.command(esc.index) > _DRIVEN, begin)


def _other_width(case: Case) -> None:
    """Let an ESC receive a PWM width that is not that of its throttle (4.4.1 explanation 5)."""
    esc = able(case)
    if esc is None:
        return
    percent, node = int(case.options["percent"]), esc.node.number
    shown = carries("MotorStatus")

    def begin() -> None:
        until, width = case.world.now + span(case), _NO_THROTTLE + 90 * percent

        def widen(case: Case, sending: Sending) -> Step:
            if sending.t > until:
                return Step.DONE
            if sending.node == node and not sending.changed and shown(sending):
                data = bytes(sending.values["data"])
                put(sending, "data", change(data, big_endian=esc.big_endian, pwm=width))
                case.mark(sending)
            return Step.MORE

        case.touch("values", widen)
        at = case.vehicle.command(esc.index)
        case.say(f"the ESC with index {esc.index} receives PWM of {width / 10:.1f} us at throttle {at}")

    once(case, lambda: case.vehicle.command(esc.index) > _DRIVEN, begin)


FAULTS: tuple[Fault, ...] = (
    Fault("BUS-006", "RawCommand at half its rate", start=_slow, early=True, also=("BUS-018",)),
    Fault(
        "BUS-007",
        "the autopilot stops commanding for a moment",
        start=_stop,
        options={"seconds": 0.4},
        limits={"seconds": (0.15, 60)},
        lasts=800 * MILLISECOND,
        also=("TYP-305", "PUSH-410", "BUS-017", "BUS-028", "BUS-025"),
    ),
    Fault(
        "BUS-016",
        "an ESC says nothing about a negative throttle",
        start=_silent_about_it,
        options={"seconds": 0.5},
        lasts=SECOND,
        also=("TYP-101", "PUSH-410", "BUS-017", "BUS-028"),
    ),
    Fault(
        "BUS-023",
        "a second node sends RawCommand",
        start=_second,
        options={"seconds": 1.0},
        lasts=SECOND,
        also=("BUS-006", "BUS-028", "TYP-103"),
    ),
    _channels(-1, "RawCommand has a channel less than there are ESCs"),
    _channels(1, "RawCommand has a channel more than there are ESCs"),
    Fault(
        "BUS-028",
        "a motor does not turn although it is commanded",
        start=_stuck,
        options={"seconds": 1.6},
        limits={"seconds": (1.2, 60)},
        lasts=2 * SECOND,
        also=("PUSH-409",),
    ),
    Fault(
        "BUS-038",
        "a motor turns on after the commands stopped",
        start=_run_on,
        options={"seconds": 2.6},
        limits={"seconds": (2.3, 60)},
        lasts=2800 * MILLISECOND,
        also=("TYP-305", "PUSH-410", "BUS-007", "BUS-017", "BUS-025", "BUS-028", "BUS-035"),
    ),
    Fault(
        "BUS-040",
        "an ESC reports another throttle than it is commanded",
        start=_less,
        options={"seconds": 6.0, "percent": 90},
        limits={"seconds": (5.5, 60), "percent": (0, 100)},
        lasts=7 * SECOND,
    ),
    Fault(
        "BUS-043",
        "an ESC receives another PWM width than that of its throttle",
        start=_other_width,
        options={"seconds": 6.5, "percent": 95},
        limits={"seconds": (6, 60), "percent": (0, 100)},
        lasts=8 * SECOND,
    ),
)
