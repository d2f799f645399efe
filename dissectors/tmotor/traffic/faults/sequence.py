"""Faults of the sequence number in PUSHSCI and PUSHCAN (4.4.4, 4.4.5): TYP-501 to TYP-504."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dissectors.tmotor.traffic.faults.occasions import chosen, put
from dissectors.traffic import Fault, Sending, Step, change

if TYPE_CHECKING:
    from collections.abc import Callable

    from dissectors.traffic import Case

_FIELD = "data_sequence"
_WRAP = 1 << 32


def _sender(case: Case) -> tuple[str, int, Any]:
    """Return the type, the node that sends it, and what counts its transfers there."""
    name = str(case.options.get("type", "PUSHCAN"))
    if name == "PUSHSCI":
        return name, case.vehicle.ground.number, case.vehicle.station
    esc = chosen(case, packets=True)
    return name, esc.node.number, esc.reports


def _shift(case: Case, by: Callable[[int], int], what: str) -> None:
    """Let a node count on from another number from the next transfer on; `by` says how far from the right one."""
    name, node, counter = _sender(case)

    def do(case: Case, sending: Sending) -> Step:
        right = sending.values[_FIELD]
        shift = by(right)
        if not shift:
            return Step.SKIP
        put(sending, _FIELD, (right + shift) % _WRAP)
        counter.data_sequence += shift
        case.say(f"{_FIELD} {what}: {(right - 1) % _WRAP} is followed by {(right + shift) % _WRAP}")
        return Step.DONE

    change(case, "values", lambda sending: sending.name == name and sending.node == node, do)


def _gap(case: Case) -> None:
    missing = max(1, int(case.options["missing"]))
    _shift(case, lambda _: missing, f"leaves out {missing}")


def _repeat(case: Case) -> None:
    _shift(case, lambda right: -1 if right else 0, "stays with other data")


def _restart(case: Case) -> None:
    _shift(case, lambda right: -right, "starts again")


def _empty(case: Case) -> None:
    """Send one more transfer behind the next one, with a sequence number of its own and no data."""
    name, number, counter = _sender(case)

    def send() -> None:
        node = case.world.node(number)
        if node is None:
            return
        own = counter.data_sequence
        counter.data_sequence = (own + 1) % _WRAP
        case.mark(node.send(name, {_FIELD: own, "data": b""}))
        case.say(
            f"a transfer without data, a payload of 4 bytes, between {_FIELD} {(own - 1) % _WRAP} and its successor"
        )

    def touch(_: Case, sending: Sending) -> Step:
        if sending.name != name or sending.node != number:
            return Step.SKIP
        case.world.at(case.world.now, send)
        return Step.DONE

    case.touch("values", touch)


_ONLY = {"type": ("PUSHSCI", "PUSHCAN")}

FAULTS: tuple[Fault, ...] = (
    Fault("TYP-501", "a sequence number leaves some out", start=_gap, options={"missing": 4}, choices=_ONLY),
    Fault("TYP-502", "a sequence number comes twice with different data", start=_repeat, choices=_ONLY),
    Fault("TYP-503", "a sequence starts again", start=_restart, choices=_ONLY),
    Fault("TYP-504", "a transfer whose data is empty", start=_empty, choices=_ONLY),
)
