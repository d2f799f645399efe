"""Too much for one bus, and motors that something else drives: BUS-001 to -003, -008, -017, -024, -032, -034."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from dissectors.times import MILLISECOND, SECOND
from dissectors.tmotor.traffic.answers import Answers
from dissectors.tmotor.traffic.esc import Esc, unique_ids
from dissectors.tmotor.traffic.faults.bus_commands import hook, negative
from dissectors.tmotor.traffic.faults.carried import carries
from dissectors.tmotor.traffic.faults.occasions import chosen, once, put, span
from dissectors.tmotor.traffic.faults.status import STATUS, status_of
from dissectors.tmotor.traffic.motor_controller import UNITS
from dissectors.tmotor.traffic.rates import rates
from dissectors.tmotor.traffic.throttle import FULL
from dissectors.traffic import Fault, Step

if TYPE_CHECKING:
    from dissectors.traffic import Case, Sending, Start

_LOOK = 50 * MILLISECOND
_FULL_RATE = 1_000_000
# A slower bus does not carry what is too much at 1 Mbit/s.
_CARRIES = 500_000
_FASTEST = 400
# Frames of one ESCStatus, and what else is on the bus in a second: RawCommand at its slowest.
_STATUS_FRAMES, _COMMANDS = 3, 400
_FIRST_ESC = 11
_PUSH = carries("MotorStatus")


def _turning(case: Case) -> bool:
    return all(case.vehicle.pilot.last)


def _hertz(case: Case, frames: int) -> int:
    """Return the rate of ESCStatus with which there are so many frames a second; 0 if no ESC reports that fast."""
    found = -(-(frames - _COMMANDS * case.world.bit_rate // _FULL_RATE) // (_STATUS_FRAMES * len(case.vehicle.escs)))
    return found if 0 < found <= _FASTEST else 0


def _hurry(case: Case, hertz: int) -> None:
    """Let all ESCs report at a rate that nobody has set; they do not say so."""
    for esc in case.vehicle.escs:
        esc.status_period = SECOND // hertz
    case.say(f"{len(case.vehicle.escs)} ESCs report at {hertz} Hz")


def _calm(case: Case) -> None:
    for esc in case.vehicle.escs:
        rate = esc.parameters["esc_fdb_rate"]
        esc.status_period = SECOND // rate if rate else 0


def _busy(case: Case) -> None:
    """Let ESCs report too often in flight, at 1 Mbit/s or near it."""
    hertz = _hertz(case, int(case.options["frames"]))
    if hertz and case.world.bit_rate >= _CARRIES:
        once(case, partial(_turning, case), lambda: _rush(case, hertz))


def _busy_slow(case: Case) -> None:
    """Let ESCs report too often in flight, on a bus that is slower."""
    rate = case.world.bit_rate
    hertz = _hertz(case, int(case.options["frames"]) * rate // _FULL_RATE)
    if hertz and rate < _FULL_RATE:
        once(case, partial(_turning, case), lambda: _rush(case, hertz))


def _rush(case: Case, hertz: int) -> None:
    until = case.world.now + span(case)
    _hurry(case, hertz)
    case.watch(STATUS, until)
    case.world.at(until, lambda: _calm(case))


def _busy_at_rest(case: Case) -> None:
    """Let ESCs report too often from the first report on, until motors turn."""
    hertz, over = _hertz(case, int(case.options["frames"])), [False]
    if not hertz or case.world.bit_rate < _FULL_RATE:
        return

    def end() -> None:
        over[0] = True
        _calm(case)

    _hurry(case, hertz)
    case.watch(lambda sending: not over[0] and STATUS(sending))
    once(case, lambda: any(case.vehicle.pilot.last), end)


def _crowd(case: Case) -> None:
    """Add ESCs that answer every question; no throttle is meant for them."""
    world, wanted, there = case.world, int(case.options["nodes"]), len(case.vehicle.escs)
    pace = rates(world.bit_rate, wanted, None)
    free = (number for number in range(_FIRST_ESC, 100) if world.node(number) is None)
    added = set()
    for index, uuid in enumerate(unique_ids(case.random, max(0, wanted - there)), there):
        node = world.device(next(free), "com.tmotor.esc")
        esc = Esc(world, node, index, uuid, pace, stock=False)
        esc.motor.voltage = case.vehicle.pack.voltage
        Answers(esc, pace)
        esc.reports.start(world.now + esc.status_period * index // wanted)
        added.add(node.number)
    case.watch(lambda sending: sending.node in added)
    case.say(f"{len(added)} more ESCs, {max(wanted, there)} in all")


def _bad_throttle(case: Case) -> None:
    """Send negative throttles: the ESC holds the last valid one until its timeout, then its motor runs out."""
    esc = chosen(case)
    shown, index = status_of(esc.node.number), esc.index

    def begin() -> None:
        until = case.world.now + span(case)
        hook(case, negative(index), until)
        case.watch(shown, until)
        case.say(f"throttle -600 for the ESC with index {index}, which holds its own for a moment")

    once(case, lambda: case.vehicle.command(index) > 0, begin)


def _configured(case: Case) -> None:
    """Set every ESC to a rate; together they are too many."""
    hertz = _hertz(case, int(case.options["frames"]))
    if not hertz or case.world.bit_rate < _CARRIES:
        return
    for turn, esc in enumerate(case.vehicle.escs):
        case.world.at(case.world.now + turn * _LOOK, partial(_set_rate, case, esc, hertz))
    case.say(f"esc_fdb_rate of {len(case.vehicle.escs)} ESCs set to {hertz}")


def _set_rate(case: Case, esc: Any, hertz: int) -> None:
    case.mark(case.vehicle.configure(esc.index, esc_fdb_rate=hertz))
    node = esc.node.number
    case.watch(lambda sending: sending.name == "ParamGet" and sending.node == node, case.world.now + _LOOK)


def _turned(case: Case) -> None:
    """Give an encoder another zero point than the position in its ESC's packets has, for the whole flight."""
    esc = chosen(case, packets=True)
    by, node = round(float(case.options["by"]) * 16_384 / 360), esc.node.number

    def turn(case: Case, sending: Sending) -> Step:
        word = sending.values.get("error_count", 0)
        if STATUS(sending) and sending.node == node and not sending.changed and word >> 16 < 16_384:
            encoder = ((word >> 16) + by) % 16_384
            put(sending, "error_count", word & 0xFFFF | encoder << 16)
            case.mark(sending)
        return Step.MORE

    case.touch("values", turn)
    case.say(f"the encoder of node {node} is {float(case.options['by']):g} degrees off")


def _by_wire(case: Case) -> None:
    """Stop RawCommand, and let the ESCs follow the same throttles that come as PWM widths (4.2)."""
    vehicle, world = case.vehicle, case.world

    def begin() -> None:
        until = world.now + span(case)
        vehicle.commanding = False

        def pulse() -> None:
            if world.now >= until:
                vehicle.commanding = True
                return
            for esc in vehicle.escs:
                esc.hear([round(FULL * wanted) for wanted in vehicle.pilot.wanted])
            world.at(world.now + 20 * MILLISECOND, pulse)

        case.watch(lambda sending: _PUSH(sending) and until - sending.t < span(case) - 100 * MILLISECOND, until)
        case.say(f"no RawCommand for {float(case.options['seconds']):g} s, the ESCs follow PWM")
        pulse()

    once(case, partial(_turning, case), begin)


_LOADED = ("BUS-001", "BUS-003", "BUS-004", "BUS-018")


def _flying(rule: str, title: str, start: Start) -> Fault:
    """Return a fault: more reports in a second than a bus may carry while motors turn."""
    return Fault(
        rule, title, start=start, options={"frames": 3000, "seconds": 1.6},
        limits={"frames": (2500, 5000), "seconds": (1.2, 60)}, lasts=1800 * MILLISECOND, also=_LOADED,
    )  # fmt: skip


FAULTS: tuple[Fault, ...] = (
    _flying("BUS-001", "too many reports while motors turn", _busy),
    Fault(
        "BUS-002",
        "too many reports while motors rest",
        start=_busy_at_rest,
        options={"frames": 4700},
        limits={"frames": (4200, 5000)},
        early=True,
        also=_LOADED,
    ),
    _flying("BUS-003", "too many reports for a slower bus", _busy_slow),
    Fault(
        "BUS-008",
        "more than 8 ESCs",
        start=_crowd,
        options={"nodes": 9},
        limits={"nodes": (9, len(UNITS))},
        lasts=500 * MILLISECOND,
        also=("TYP-103", "BUS-026"),
    ),
    Fault(
        "BUS-017",
        "an ESC holds its throttle for a moment after negative ones",
        start=_bad_throttle,
        options={"seconds": 0.5},
        limits={"seconds": (0.2, 60)},
        lasts=700 * MILLISECOND,
        also=("TYP-101", "TYP-305", "PUSH-410", "BUS-016", "BUS-028"),
    ),
    Fault(
        "BUS-024",
        "ESCs are set to more reports than a bus carries",
        start=_configured,
        options={"frames": 2600},
        limits={"frames": (2450, 5000)},
        lasts=1500 * MILLISECOND,
        also=_LOADED,
    ),
    Fault(
        "BUS-032",
        "the encoder and the position in packets have different zero points",
        start=_turned,
        options={"by": 10.0},
        limits={"by": (3, 357)},
        early=True,
    ),
    Fault(
        "BUS-034",
        "PWM takes over when RawCommand stops",
        start=_by_wire,
        options={"seconds": 1.0},
        limits={"seconds": (0.5, 60)},
        lasts=1300 * MILLISECOND,
        also=("BUS-007", "BUS-017"),
    ),
)
