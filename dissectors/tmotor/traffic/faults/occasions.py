"""Transfers that a fault needs, now instead of when they would come by themselves."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dissectors.layout import PrimitiveType
from dissectors.times import MILLISECOND, SECOND
from dissectors.traffic import Code, Step, change

if TYPE_CHECKING:
    from collections.abc import Callable

    from dissectors.layout import CompoundType
    from dissectors.traffic import BusNode, Case, Fits, Sending, Touch

    # Whether a value breaks the rule.
    Wrong = Callable[[float], bool]


# The largest number of a float16; a sender saturates what is larger.
_LARGEST = 65_504.0
_LOOK = 50 * MILLISECOND


def span(case: Case) -> int:
    """Return how many ns the fault lasts by its setting in seconds."""
    return round(float(case.options["seconds"]) * SECOND)


def once(case: Case, ready: Callable[[], bool], do: Callable[[], None], every: int = _LOOK) -> None:
    """Do it as soon as it can be done; look for that every so many ns."""
    if ready():
        do()
    else:
        case.world.at(case.world.now + every, lambda: once(case, ready, do, every))


def chosen(case: Case, *, packets: bool = False) -> Any:
    """Return the ESC that the settings name by its node, else any that speaks T-Motor's protocol, if there is one.

    With `packets` it is one that sends PUSHCAN.
    """
    escs, node = case.vehicle.escs, case.options.get("node")
    named = next((esc for esc in escs if esc.node.number == node), None)
    able = [esc for esc in escs if not esc.stock and (esc.unit is not None or not packets)]
    return named or case.random.choice(able or escs)


def provoke(case: Case, name: str, stage: str, do: Touch, esc: Any) -> None:
    """Let `do` change the next transfer of a type that `esc` sends or, if it is a command, that is meant for it.

    What an ESC sends only when it is asked is asked for, by a ParamCfg or a packet that changes nothing.
    """
    vehicle = case.vehicle
    senders = {"RawCommand": vehicle.autopilot, "ParamCfg": vehicle.ground, "PUSHSCI": vehicle.ground}
    node = senders.get(name, esc.node).number
    change(case, stage, lambda sending: sending.name == name and sending.node == node, do)
    if name in {"ParamCfg", "ParamGet"}:
        vehicle.configure(esc.index, esc_save_option=0)
    elif name == "PUSHSCI" and esc.unit is not None:
        vehicle.push("FocQuery", esc.unit)


def has_room(layout: CompoundType, field: str, value: object) -> bool:
    """Return if a field can hold a number as it is; what is no number, or no field of one, has room."""
    kind = layout.member(field)
    if not isinstance(kind, PrimitiveType) or not isinstance(value, int | float) or isinstance(value, Code):
        return True
    if kind.kind == "float":
        return abs(value) <= _LARGEST or kind.bits > 16
    low = -(1 << kind.bits - 1) if kind.kind == "int" else 0
    return low <= value < low + (1 << kind.bits)


def put(sending: Sending, name: str, value: Any) -> Any:
    """Replace the value of a field and return what it was; who built the transfer keeps its own values."""
    before = sending.values[name]
    sending.values = {**sending.values, name: value}
    return before


def misreport(case: Case, fits: Fits, field: str, value: Any, until: int | None = None) -> None:
    """Have all coming transfers that fit say another value, up to a time."""

    def lie(case: Case, sending: Sending) -> Step:
        if until is not None and sending.t > until:
            return Step.DONE
        if fits(sending) and not sending.changed:
            put(sending, field, value)
            case.mark(sending)
        return Step.MORE

    case.touch("values", lie)


def unsent(node: BusNode, sending: Sending) -> None:
    """Take a message back: it was never sent, so it takes no transfer ID."""
    node.transfer_ids[sending.name, None] = sending.transfer_id
    sending.frames = []


def replaced(case: Case, sending: Sending, name: str, value: float, wrong: Wrong = lambda _: True) -> Step:
    """Replace the value of a field and say so; skip what has no such field, and a value that is not `wrong`."""
    if name not in sending.values or not wrong(value) or not has_room(sending.message.layout, name, value):
        return Step.SKIP
    before = put(sending, name, value)
    case.say(f"{name} set from {before} to {value}")
    return Step.DONE
