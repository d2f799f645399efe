"""Holes of a recording and steps of its clock, told apart by transfer IDs and uptimes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.flight.clock import Spot
from analyzer.flight.log import FlightEvent
from analyzer.flight.thresholds import lasting
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.flight.clock import Hole, RecordedClock

DISORDER = "disorder"


def hole_events(clock: RecordedClock) -> Iterator[FlightEvent]:
    """Yield what each hole was, as far as that can be told."""
    for hole, place in zip(clock.holes, clock.places_of_holes(), strict=True):
        kind, text, sign = *_told(hole), DISORDER if _older(hole) else ""
        first = Spot(hole.t_end, place, hole.frame, hole.frame, 0)
        ordered, jumped, anew = hole.steps
        values = {"length_s": hole.length / SECOND, "ids_run_on": ordered, "ids_jump": jumped, "ids_anew": anew}
        yield FlightEvent(kind, text, Spot(hole.t, place, hole.frame, hole.frame, 0), first, values=values, sign=sign)


def _told(hole: Hole) -> tuple[str, str]:
    """Return kind and text: senders whose IDs run on were not cut off."""
    seconds = f"{abs(hole.length) / SECOND:.3f} s"
    if _older(hole):
        return "clock", f"time goes back by {seconds}, and uptimes with it: an older part stands behind a newer one"
    if hole.length < 0:
        return "clock", f"the clock steps back by {seconds}"
    ordered, jumped, anew = hole.steps
    senders = ordered + jumped + anew
    why = ""
    if 2 * ordered > senders:
        passed = _passed(hole)
        if passed is False:
            return "clock", f"the clock steps by +{seconds}: transfer IDs run on, uptimes do not grow by it"
        why = f": transfer IDs run on, nobody sent{'' if passed else ' or the clock stepped'}"
    elif 2 * anew > senders:
        why = ": transfer IDs begin anew, the vehicle was powered up again"
    elif 2 * jumped > senders:
        why = f": transfer IDs of {jumped} of {senders} senders jump, frames are missing"
    return "gap", f"no frame for {seconds}{why}"


def _older(hole: Hole) -> bool:
    """Return whether nodes grew younger as the time went back: that is no clock that was set."""
    older = sorted(hole.uptimes)
    if not older or hole.length > -lasting("clock_least"):
        return False
    return abs(older[len(older) // 2] - hole.length) <= max(lasting("restart"), -hole.length // 10)


def _passed(hole: Hole) -> bool | None:
    """Return whether nodes grew older by that time; None if that cannot be told."""
    if hole.length < lasting("clock_least"):
        return True
    older = sorted(hole.uptimes)
    if not older:
        return None
    return older[len(older) // 2] > hole.length - max(lasting("restart"), hole.length // 10)
