"""Settings that an ESC confirms, and what follows from them or does not: BUS-039 and BUS-041."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dissectors.times import MILLISECOND, SECOND
from dissectors.tmotor.traffic.faults.occasions import chosen, once
from dissectors.traffic import Fault, Step

if TYPE_CHECKING:
    from collections.abc import Callable

    from dissectors.traffic import Case, Sending

_INDEXES = range(20)
_PWM = 0


def _confirmed(case: Case, esc: Any, name: str, value: int, then: Callable[[], None]) -> None:
    """Set a field of an ESC and go on with its answer that confirms the value."""
    field = {"esc_id_set": "esc_id_req"}.get(name, name)

    def answer(case: Case, sending: Sending) -> Step:
        if sending.name != "ParamGet" or sending.node != esc.node.number or sending.values[field] != value:
            return Step.MORE
        case.mark(sending)
        then()
        return Step.DONE

    case.mark(case.vehicle.configure(esc.index, **{name: value}))
    case.touch("frames", answer)


def _unused(case: Case) -> None:
    """Give an ESC an ID that nobody has; it confirms it and goes on with the one it had."""
    esc = chosen(case)
    free = [index for index in _INDEXES if index not in {other.index for other in case.vehicle.escs}]
    if esc.stock or not free:
        return
    case.say(f"the ESC with index {esc.index} confirms the ID {free[0]} and does not use it")
    _confirmed(case, esc, "esc_id_set", free[0], lambda: None)


def _pwm_first(case: Case) -> None:
    """Let an ESC take PWM first, and go on commanding it."""
    esc = chosen(case)

    def commanded(case: Case, sending: Sending) -> Step:
        if sending.name != "RawCommand" or not any(sending.values["cmd"][esc.index : esc.index + 1]):
            return Step.MORE
        case.mark(sending)
        return Step.DONE

    def begin() -> None:
        case.say(f"the ESC with index {esc.index} is set to take PWM first while it is commanded by CAN")
        _confirmed(case, esc, "esc_signal_priority", _PWM, lambda: case.touch("frames", commanded))

    if not esc.stock:
        once(case, lambda: case.vehicle.command(esc.index) > 0, begin)


FAULTS: tuple[Fault, ...] = (
    Fault("BUS-039", "an ESC confirms an ID and does not use it", start=_unused, lasts=5 * SECOND // 2),
    Fault("BUS-041", "an ESC that is commanded takes PWM first", start=_pwm_first, lasts=500 * MILLISECOND),
)
