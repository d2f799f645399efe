"""Faults of what a MotorStatus packet says (4.4.5 table 1): PUSH-401 to PUSH-410, each in one packet."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dissectors.tmotor.traffic.faults.carried import carries, misuse, read
from dissectors.traffic import Fault, Step

if TYPE_CHECKING:
    from dissectors.tmotor.traffic.faults.occasions import Wrong
    from dissectors.traffic import Case, Sending, Touch

_STATUS = carries("MotorStatus")
# Numbers that only grow while an ESC is on, and by how much at most from one status to the next.
_GROWING = {"runtime": 10, "power_on_count": 0}
# Numbers that ESCStatus has too, and the share by which both may differ.
_SHARED = {"voltage": 0.02, "speed": 0.05, "current": 0.10}
# Both numbers are rounded: a float16 to a share, the other to its unit.
_ROUNDING, _UNIT = 0.002, 2


def _said(rule: str, title: str, field: str, value: int, *also: str, wrong: Wrong | None = None) -> Fault:
    """Return a fault: a raw value that a field must not have, `wrong` or by default one that the document forbids."""

    def touch(case: Case, sending: Sending) -> Step:
        return misuse(case, sending, field, int(case.options["value"]), wrong)

    return _fault(rule, title, touch, {"value": value}, *also)


def _fault(rule: str, title: str, touch: Touch, options: dict[str, int | float | str], *also: str) -> Fault:
    return Fault(rule, title, values=touch, fits=_STATUS, options=options, also=also)


def _pulse(value: float) -> bool:
    """Return if it is neither 1040 to 1940 us nor 1050 to 1950 us (4.4.1 explanation 5); 0 is no signal."""
    return value != 0 and not 10_400 <= value <= 19_500


def _odd(value: float) -> bool:
    """Return if it is below zero in 16 bits with a sign, or kelvin."""
    return value >= 0x8000 or 23_315 <= value <= 47_315


def _number(case: Case, sending: Sending, field: str) -> int | None:
    """Return the number that a packet says; None if it has no such number."""
    found = read(case, sending)
    value = None if found is None else found[1].get(field)
    return value if isinstance(value, int) else None


def _temperature(case: Case, sending: Sending) -> Step:
    """Shift a temperature, which runs over as 16 bits do."""
    value, by = _number(case, sending, "temperature"), int(case.options["by"])
    return Step.SKIP if value is None else misuse(case, sending, "temperature", value + by & 0xFFFF, _odd)


def _backward(case: Case, sending: Sending) -> Step:
    """Make it lower than in the packet before; what cannot be so low is left for a later packet.

    How high it was is known from the second packet on. Before, the most is assumed that it can have grown since.
    """
    field, by = str(case.options["field"]), int(case.options["by"])
    value = _number(case, sending, field)
    if value is None or field not in _GROWING or not sending.values["data_sequence"]:
        return Step.SKIP
    sender = str(sending.node)
    before = case.state.get(sender, value - _GROWING[field])
    case.state[sender] = value
    return misuse(case, sending, field, value - by, lambda lower: lower < before)


def _limit(case: Case, sending: Sending) -> Step:
    field, value = str(case.options["field"]), int(case.options["value"])
    if field not in {"speed", "current"}:
        return Step.SKIP
    return misuse(case, sending, field, value, lambda value: abs(value) >= 0x7FFF)


def _disagreement(case: Case, sending: Sending) -> Step:
    """Report some percent more than ESCStatus says, which is made of the same sample."""
    field = str(case.options["field"])
    value = _number(case, sending, field)
    if value is None or field not in _SHARED:
        return Step.SKIP

    def differs(other: float) -> bool:
        most = max(abs(value), abs(other))
        return abs(other - value) > (_SHARED[field] + _ROUNDING) * most + _UNIT

    return misuse(case, sending, field, value + round(value * float(case.options["percent"]) / 100), differs)


FAULTS: tuple[Fault, ...] = (
    _said("PUSH-401", "a system status that the document does not know", "system_status", 0x42),
    _said("PUSH-402", "a motor position above 360 degrees", "position", 36_500, "BUS-032"),
    _said("PUSH-403", "a PWM width that no receiver takes", "pwm", 22_500, wrong=_pulse),
    _said("PUSH-404", "an output throttle above 100 %", "throttle", 252),
    # As many hundredths as kelvin has more than degrees Celsius.
    _fault("PUSH-405", "a temperature that is not in degrees Celsius", _temperature, {"by": 27_315}),
    _said("PUSH-406", "a motor status that is not zero", "motor_status", 1, wrong=lambda value: value != 0),
    _fault("PUSH-407", "a runtime or a power-on count goes backwards", _backward, {"field": "runtime", "by": 60}),
    _fault("PUSH-408", "a number at its limit", _limit, {"field": "current", "value": 32_767}, "PUSH-409"),
    _said("PUSH-410", "a fault flag of the motor", "fault", 0x0020, wrong=lambda value: value != 0),
    _fault("PUSH-409", "MotorStatus and ESCStatus disagree", _disagreement, {"field": "voltage", "percent": 12.0}),
)
