"""Faults of a whole vehicle in flight: a pack that breaks down (BUS-036), a recording that just ends (CAP-005)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dissectors.times import SECOND
from dissectors.tmotor.traffic.faults.occasions import once, span
from dissectors.traffic import Fault, Step

if TYPE_CHECKING:
    from dissectors.traffic import Case, Sending

_UNDER_VOLTAGE = 1


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
    Fault("CAP-005", "the recording ends in flight", start=_watch, also=("TRF-008",)),
)
