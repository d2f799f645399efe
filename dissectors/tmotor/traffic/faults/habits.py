"""Habits of one ESC throughout a capture, because its firmware is another: TYP-009, TYP-301 and TYP-307."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dissectors.times import SECOND
from dissectors.tmotor.traffic.faults.occasions import chosen
from dissectors.tmotor.traffic.faults.status import STATUS
from dissectors.traffic import Fault, Sending, Step

if TYPE_CHECKING:
    from dissectors.traffic import Case, Fits


def _statuses(esc: Any) -> Fits:
    return lambda sending: STATUS(sending) and sending.node == esc.node.number


def _coarse(case: Case) -> None:
    esc = chosen(case)
    esc.coarse = True
    case.watch(_statuses(esc))
    case.say("voltage, current and temperature pass the float16 encoder of 5.2: up to 8 ULP high, low 3 bits zero")


def _kelvin(case: Case) -> None:
    esc = chosen(case)
    esc.kelvin = True
    case.watch(_statuses(esc))
    case.say("temperature in kelvin")


def _counter(case: Case) -> None:
    """Make it a stock ESC: no packets, no parameters, and a first word that counts errors."""
    esc, world, seconds = chosen(case), case.world, float(case.options["seconds"])
    esc.stock, esc.unit = True, None
    first = esc.reports.errors = case.random.randrange(2, 9)

    def rise() -> None:
        if world.now:
            esc.reports.errors += case.random.randint(1, 2)
        case.say(f"error_count counts errors, {first} to {esc.reports.errors}; PUSHCAN and ParamGet are not sent")
        world.at(world.now + round(seconds * case.random.uniform(0.6, 1.4) * SECOND), rise)

    def mute(_: Case, sending: Sending) -> Step:
        if sending.node == esc.node.number and sending.name == "ParamGet":
            sending.frames = []
        return Step.MORE

    case.watch(_statuses(esc))
    case.touch("frames", mute)
    rise()


FAULTS: tuple[Fault, ...] = (
    Fault("TYP-009", "an ESC with the float16 encoder that the document prints", start=_coarse, early=True),
    Fault("TYP-301", "an ESC that reports its temperature in kelvin", start=_kelvin, early=True),
    Fault(
        "TYP-307",
        "an ESC whose first status word counts errors",
        start=_counter,
        early=True,
        options={"seconds": 0.8},
        also=("TYP-304", "TYP-305", "PUSH-102", "PUSH-201", "PUSH-304", "BUS-011", "BUS-012"),
    ),
)
