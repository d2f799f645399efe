"""Faults of a whole vehicle in flight.

A pack that breaks down (BUS-036), ESCs that are switched off (BUS-042), a recording that just ends (CAP-005).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from dissectors.times import MILLISECOND, SECOND
from dissectors.tmotor.traffic.faults.occasions import once, span
from dissectors.traffic import Fault, Step

if TYPE_CHECKING:
    from dissectors.traffic import Case, Sending

_UNDER_VOLTAGE = 1
# In so long every ESC reports that its motor stands.
_REPORTED = 500 * MILLISECOND


def _turning(case: Case) -> bool:
    return all(case.vehicle.pilot.last)


def _sag(case: Case) -> None:
    """Let all ESCs that speak T-Motor's protocol report under-voltage, once motors turn."""
    mask = 1 << _UNDER_VOLTAGE

    def shows(sending: Sending) -> bool:
        return sending.name == "ESCStatus" and bool(sending.values["error_count"] & mask)

    def fall() -> None:
        case.watch(shows, case.world.now + span(case) + SECOND)
        case.say(f"every ESC reports under-voltage for {float(case.options['seconds']):g} s")
        for esc in case.vehicle.escs:
            esc.fault_bits |= mask
        case.world.at(case.world.now + span(case), rise)

    def rise() -> None:
        for esc in case.vehicle.escs:
            esc.fault_bits &= ~mask

    if len(case.vehicle.escs) > 1 and not any(esc.stock for esc in case.vehicle.escs):
        once(case, lambda: _turning(case), fall)


def _off(case: Case) -> None:
    """Take all throttles away and, once the motors stand and have said so, the power of the ESCs, too."""
    vehicle, world = case.vehicle, case.world

    def off() -> None:
        for esc in vehicle.escs:
            esc.node.silent = True
        case.say(f"all {len(vehicle.escs)} ESCs are switched off, their motors at rest")

    def last(case: Case, sending: Sending) -> Step:
        """Mark the last reports: those of motors that stand."""
        if sending.name == "ESCStatus" and not sending.values["rpm"] and sending.t >= since[0]:
            case.mark(sending)
        return Step.MORE

    since: list[int] = []

    def stand() -> None:
        since.append(world.now)
        case.touch("frames", last)
        world.at(world.now + _REPORTED, off)

    if len(vehicle.escs) > 1:
        vehicle.throttle_hook = lambda commands: [0] * len(commands)
        once(case, lambda: not any(esc.motor.speed for esc in vehicle.escs), stand)


def _end(case: Case, sending: Sending) -> Step:
    """End the recording behind the next transfer while motors turn."""
    if not _turning(case):
        return Step.SKIP
    case.mark(sending.frames[-1])
    case.say("the recording ends while motors turn")
    case.world.cut(sending.frames[-1])
    return Step.DONE


def _watch(case: Case) -> None:
    case.touch("frames", _end)


FAULTS: tuple[Fault, ...] = (
    Fault(
        "BUS-036",
        "the pack breaks down: every ESC reports under-voltage",
        start=_sag,
        options={"seconds": 1.0},
        lasts=SECOND,
        also=("TYP-305", "PUSH-410"),
    ),
    Fault("BUS-042", "all ESCs are switched off once their motors stand", start=_off, lasts=4 * SECOND),
    Fault("CAP-005", "the recording ends in flight", start=_watch, also=("TRF-008",)),
)
