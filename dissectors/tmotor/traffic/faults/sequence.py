"""Faults of the sequence number in PUSHSCI and PUSHCAN (4.4.4, 4.4.5): TYP-501 to TYP-504."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dissectors.tmotor.traffic.faults.occasions import chosen, put
from dissectors.traffic import Fault, Sending, Step

if TYPE_CHECKING:
    from collections.abc import Callable

    from dissectors.traffic import Case

_FIELD = "data_sequence"
_WRAP = 1 << 32


def _sender(case: Case, name: str) -> Any:
    return case.vehicle.ground if name == "PUSHSCI" else chosen(case, packets=True).node


def _shift(case: Case, by: Callable[[int], int], what: str) -> None:
    """From the next transfer on, a node counts on from another number; `by` says from the right one how far away."""
    name = str(case.options.get("type", "PUSHCAN"))
    node = _sender(case, name).number
    shift: int | None = None

    def touch(case: Case, sending: Sending) -> Step:
        nonlocal shift
        if sending.name != name or sending.node != node:
            return Step.SKIP
        right = sending.values[_FIELD]
        if shift is None:
            shift = by(right)
            if not shift:
                return Step.DONE
            case.mark(sending)
            case.say(f"{_FIELD} {what}: {(right - 1) % _WRAP} is followed by {(right + shift) % _WRAP}")
        put(sending, _FIELD, (right + shift) % _WRAP)
        return Step.MORE

    case.touch("values", touch)


def _gap(case: Case) -> None:
    missing = max(1, int(case.options["missing"]))
    _shift(case, lambda _: missing, f"leaves out {missing}")


def _repeat(case: Case) -> None:
    _shift(case, lambda right: -1 if right else 0, "stays with other data")


def _restart(case: Case) -> None:
    _shift(case, lambda right: -right, "starts again")


def _empty(case: Case) -> None:
    """One more transfer behind the next one, with a sequence number of its own and no data."""
    name, world = str(case.options.get("type", "PUSHCAN")), case.world
    node = _sender(case, name)
    last: int | None = None
    added = 0

    def send() -> None:
        nonlocal added
        added = 1
        case.mark(node.send(name, {_FIELD: last, "data": b""}))
        case.say(f"a transfer without data, a payload of 4 bytes, between {_FIELD} {last} and its successor")

    def touch(_: Case, sending: Sending) -> Step:
        nonlocal last
        if sending.name != name or sending.node != node.number:
            return Step.SKIP
        if last is None:
            world.at(world.now, send)
        last = put(sending, _FIELD, (sending.values[_FIELD] + added) % _WRAP)
        return Step.MORE

    case.touch("values", touch)


FAULTS: tuple[Fault, ...] = (
    Fault("TYP-501", "a sequence number leaves some out", start=_gap, options={"missing": 4}),
    Fault("TYP-502", "a sequence number comes twice with different data", start=_repeat),
    Fault("TYP-503", "a sequence starts again", start=_restart),
    Fault("TYP-504", "a transfer whose data is empty", start=_empty),
)
