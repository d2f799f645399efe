"""Faults of FocFeedback packets (4.4.5 table 2): PUSH-103, PUSH-501 and PUSH-502. The ground station asks for them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dissectors.tmotor.traffic.faults.carried import (
    COMPARED,
    UNSAID,
    able,
    asked,
    carries,
    description,
    forbidden,
    read,
    rewrite,
)
from dissectors.tmotor.traffic.faults.occasions import has_room
from dissectors.traffic import Fault, Step, change

if TYPE_CHECKING:
    from dissectors.traffic import Case, Sending, Touch

_FEEDBACK = carries("FocFeedback")
_VERSIONS = ("hardware_version", "software_version")
# FOC parameters with a range, and a value behind it; the document breaks off where it says what a save option of 2 is.
_BEYOND = {"position_loop": 2, "throttle_priority": 2, "bus_rate": 6, "report_rate": 401, "save_option": 3}


def _next(case: Case, esc: Any, do: Touch) -> None:
    """Let `do` change the next feedback of an ESC."""
    node = esc.node.number
    change(case, "values", lambda sending: sending.node == node and _FEEDBACK(sending), do)


def _asked(case: Case, do: Touch) -> None:
    esc = able(case)
    if esc is not None:
        _next(case, esc, do)
        case.vehicle.push("FocQuery", esc.unit)


def _differs(case: Case) -> None:
    """Send a set of FOC parameters, of a value that is in force already; what is fed back is another one."""
    esc, by = able(case), int(case.options["by"])
    if esc is None:
        return
    value = esc.parameters["esc_acc_threshold"]
    if not by or not has_room(description(case, "PUSHCAN", "FocFeedback").layout, "acceleration_limit", value + by):
        return
    command = case.vehicle.push("FocParameters", esc.unit, acceleration_limit=value)

    def fake(case: Case, sending: Sending) -> Step:
        found = read(case, sending)
        if found is None or command.frames[-1].t < 0:  # what is not through yet has no answer
            return Step.SKIP
        return rewrite(case, sending, acceleration_limit=found[1]["acceleration_limit"] + by)

    case.answer.node, case.answer.type = esc.node.number, "PUSHCAN"
    case.mark(command)
    _next(case, esc, fake)


def _version(case: Case) -> None:
    """Garble a version text: ASCII ends at 0x7F."""
    field, value = str(case.options["field"]), int(case.options["value"])

    def garble(case: Case, sending: Sending) -> Step:
        found = read(case, sending)
        return Step.SKIP if found is None else rewrite(case, sending, **{field: bytes((value,)) + found[1][field][1:]})

    if field in _VERSIONS and 0x7F < value <= 0xFF:
        _asked(case, garble)


def _out_of_range(case: Case) -> None:
    wanted = asked(case, _BEYOND)
    if wanted is None or not forbidden(description(case, "PUSHCAN", "FocFeedback"), *wanted):
        return
    field, value = wanted
    if field in COMPARED:
        case.answer.also = ("PUSH-103",)
    _asked(case, lambda case, sending: rewrite(case, sending, **{field: value}))


FAULTS: tuple[Fault, ...] = (
    Fault(
        "PUSH-103",
        "FOC parameters are fed back otherwise than set",
        start=_differs,
        options={"by": 10},
        also=("PUSH-305",),
    ),
    Fault(
        "PUSH-501",
        "a version text with a byte that is no character",
        start=_version,
        options={"field": "hardware_version", "value": 0xB5},
    ),
    Fault(
        "PUSH-502",
        "a FOC parameter fed back out of range",
        start=_out_of_range,
        options={"field": "save_option", "value": UNSAID},
    ),
)
