"""Faults of values that any data type can have.

TYP-007, TYP-008 (floats), TYP-011 (unions), TYP-012 (void bits) and TYP-014 (codes).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

from dissectors.layout import CompoundType, PrimitiveType
from dissectors.traffic import Case, Code, Fault, Sending, Step, change, of

if TYPE_CHECKING:
    from collections.abc import Callable

    from dissectors.schema import Message
    from dissectors.traffic import Touch

_Kind = TypeVar("_Kind", CompoundType, PrimitiveType)
# Width of a float's mantissa.
_MANTISSA = {16: 10, 32: 23, 64: 52}
# Standard DroneCAN: a union and void bits, and every device may be asked.
_ANSWER = "uavcan.protocol.param.GetSet.Response"
_STATUS = "uavcan.protocol.NodeStatus"
# Modes of a node: operational, initialization, maintenance, software update, offline.
_MODES = (0, 1, 2, 3, 7)


def _floats(message: Message) -> dict[str, int]:
    """Return the width of every float that is a field of its own."""
    fields = message.layout.fields
    return {
        member.name: member.type.bits
        for member in fields
        if isinstance(member.type, PrimitiveType) and member.type.kind == "float"
    }


def _float(case: Case, sending: Sending, *, number: bool, negative: bool = False) -> Step:
    """Replace a float, the last one unless another is named, by infinity or, if not a `number`, by NaN."""
    floats = _floats(sending.message)
    name = str(case.options["field"]) or next(reversed(floats), "")
    if name not in floats:
        return Step.SKIP
    width = floats[name]
    mantissa = _MANTISSA[width]
    code = (1 << width - 1 - mantissa) - 1 << mantissa | (0 if number else 1 << mantissa - 1) | negative << width - 1
    before = sending.values[name]
    sending.values = {**sending.values, name: Code(code)}
    what = ("-" if negative else "") + ("infinity" if number else "NaN")
    case.say(f"{name} set from {before:g} to {what}, code 0x{code:0{width // 4}X}")
    return Step.DONE


def _nan(case: Case, sending: Sending) -> Step:
    return _float(case, sending, number=False)


def _infinity(case: Case, sending: Sending) -> Step:
    return _float(case, sending, number=True, negative=int(case.options["sign"]) < 0)


def _has_float(sending: Sending) -> bool:
    return bool(_floats(sending.message)) and not sending.message.actuates


def _first(message: Message, kind: type[_Kind], wanted: Callable[[_Kind], bool]) -> tuple[int, _Kind] | None:
    """Return the first field of a kind and the bits in front of it; None behind what has no fixed size."""
    bits = 0
    for member in message.layout.fields:
        if isinstance(member.type, kind) and wanted(member.type):
            return bits, member.type
        if member.type.min_bits != member.type.max_bits:
            return None
        bits += member.type.min_bits
    return None


def _write(payload: bytes, at: int, width: int, value: int) -> bytes:
    """Return the payload with `width` bits from bit `at` replaced; bit 0 is the highest of the first byte."""
    shift = 8 * len(payload) - at - width
    number = int.from_bytes(payload, "big") & ~((1 << width) - 1 << shift) | value << shift
    return number.to_bytes(len(payload), "big")


def _tag(case: Case, sending: Sending) -> Step:
    """Give a union the tag of no field."""
    found = _first(sending.message, CompoundType, lambda inner: inner.union)
    if found is None:
        return Step.SKIP
    at, union = found
    count, wanted = len(union.fields), int(case.options["tag"])
    if not count <= wanted < 1 << union.tag_bits:
        wanted = (1 << union.tag_bits) - 1
    if wanted < count:
        return Step.SKIP
    sending.payload = _write(sending.payload, at, union.tag_bits, wanted)
    case.say(f"union tag of {union.name} set to {wanted}; it has the fields 0 to {count - 1}")
    return Step.DONE


def _void(case: Case, sending: Sending) -> Step:
    """Fill the first void of a payload."""
    found = _first(sending.message, PrimitiveType, lambda inner: inner.kind == "void")
    if found is None:
        return Step.SKIP
    at, width = found[0], found[1].bits
    bits = int(case.options["bits"]) & (1 << width) - 1 or (1 << width) - 1
    sending.payload = _write(sending.payload, at, width, bits)
    case.say(f"the {width} void bits from bit {at} of the payload on set from 0 to {bits:0{width}b}")
    return Step.DONE


def _code(case: Case, sending: Sending) -> Step:
    """Say a mode that DroneCAN does not name."""
    mode = int(case.options["mode"])
    if sending.name != _STATUS or mode in _MODES:
        return Step.SKIP
    before = sending.values["mode"]
    sending.values = {**sending.values, "mode": mode}
    case.say(f"mode set from {before} to {mode}, which has no name")
    return Step.DONE


def _in_answer(case: Case, do: Touch) -> None:
    """Let `do` change the answer of a device that is asked for a parameter, or the next transfer of another type."""
    vehicle, node, name = case.vehicle, case.options.get("node"), case.options.get("type", _ANSWER)
    numbers: list[int] = [esc.node.number for esc in vehicle.escs]
    if name == _ANSWER and node not in numbers:
        node = case.random.choice(numbers)
    change(case, "transfer", lambda sending: sending.name == name and node in (None, sending.node), do)
    if name == _ANSWER:
        vehicle.settings.ask(vehicle.ground, node)


FAULTS: tuple[Fault, ...] = (
    Fault("TYP-007", "a float is NaN", values=_nan, fits=_has_float, options={"field": ""}),
    Fault(
        "TYP-008",
        "a float is infinite",
        values=_infinity,
        fits=_has_float,
        options={"field": "", "sign": 1},
        also=("TYP-308",),
    ),
    Fault(
        "TYP-011",
        "the tag of a union names none of its fields",
        start=lambda case: _in_answer(case, _tag),
        options={"tag": 7},
    ),
    Fault(
        "TYP-012",
        "void bits are not zero",
        start=lambda case: _in_answer(case, _void),
        options={"bits": 1},
    ),
    Fault(
        "TYP-014",
        "a node reports a mode that has no name",
        values=_code,
        fits=of(_STATUS),
        options={"mode": 5},
        limits={"mode": (0, 7)},
        also=("BUS-022",),
    ),
)
