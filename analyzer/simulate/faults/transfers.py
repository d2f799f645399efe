"""Faults of transfers (TRF rules)."""

from __future__ import annotations

from analyzer.simulate.wire import TOGGLE, retail
from dissectors.traffic import Case, Fault, Sending, Step


def _toggle(case: Case, sending: Sending) -> Step:
    if len(sending.frames) < 3:
        return Step.SKIP
    retail(sending.frames[1], TOGGLE)
    case.say("toggle of the second frame flipped")
    return Step.DONE


FAULTS: tuple[Fault, ...] = (Fault("TRF-003", "the toggle bit of a frame does not alternate", frames=_toggle),)
