"""Faults in the length of a payload: TYP-001 to TYP-005, for data types of any vendor."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.simulate.faults.helpers import telemetry
from dissectors.layout import ArrayType, PrimitiveType, wire_bits
from dissectors.traffic import Case, Fault, Sending, Step

if TYPE_CHECKING:
    from dissectors.schema import Message

# Rules that compare the number of elements with that of devices.
_COUNTS = ("TYP-103", "BUS-026", "BUS-027")
# No payload grows by more bytes or elements.
_MOST = 1000


def spare(sending: Sending) -> int:
    """Count bits of the last byte that belong to no field, 0 too for a layout whose size depends on its values."""
    low, high = wire_bits(sending.message.layout, tail=True)
    found = tail(sending.message)
    if found is None:
        return -low % 8 if low == high else 0
    head, name, array = found
    return -(head + len(sending.values[name]) * array.element.max_bits) % 8


def tail(message: Message) -> tuple[int, str, ArrayType] | None:
    """Return bits in front, name and type of the array that ends a payload without a length field."""
    *front, last = message.layout.fields or (None,)
    if message.layout.union or last is None or not isinstance(last.type, ArrayType) or not last.type.dynamic:
        return None
    sizes = [(member.type.min_bits, member.type.max_bits) for member in front if member is not None]
    element = last.type.element
    if element.min_bits < 8 or element.min_bits != element.max_bits or any(low != high for low, high in sizes):
        return None
    return sum(low for low, _ in sizes), last.name, last.type


def _padded(sending: Sending) -> bool:
    return telemetry(sending) and spare(sending) > 0


def _odd(sending: Sending) -> bool:
    found = tail(sending.message)
    return found is not None and found[2].element.max_bits % 8 != 0


def _ends_in_array(sending: Sending) -> bool:
    return tail(sending.message) is not None


def _short(case: Case, sending: Sending) -> Step:
    least = sending.message.min_bytes
    size = least - int(case.options["bytes"])
    if not 0 <= size < least:
        return Step.SKIP
    sending.payload = sending.payload[:size]
    case.say(f"payload cut to {size} bytes; the type has at least {least}")
    return Step.DONE


def _long(case: Case, sending: Sending) -> Step:
    most, extra = sending.message.max_bytes, int(case.options["bytes"])
    if not 1 <= extra <= _MOST:
        return Step.SKIP
    sending.payload = sending.payload.ljust(most, b"\0") + bytes(extra)
    case.say(f"{extra} zero byte(s) behind the payload, {most + extra} bytes; the type has at most {most}")
    return Step.DONE


def _padding(case: Case, sending: Sending) -> Step:
    width = spare(sending)
    bits = int(case.options["bits"]) & (1 << width) - 1 or (1 << width) - 1
    if not width:
        return Step.SKIP
    sending.payload = sending.payload[:-1] + bytes((sending.payload[-1] | bits,))
    case.say(f"the {width} padding bits of byte {len(sending.payload)} set from 0 to {bits:0{width}b}")
    return Step.DONE


def _uneven(case: Case, sending: Sending) -> Step:
    found = tail(sending.message)
    if found is None:
        return Step.SKIP
    head, name, array = found
    size, most, width = len(sending.payload), sending.message.max_bytes, array.element.max_bits
    near = sorted(range(-(-head // 8) + 1, most + 1), key=lambda wanted: (abs(wanted - size), -wanted))
    wanted = next((wanted for wanted in near if (8 * wanted - head) % width >= 8 and wanted != size), None)
    if wanted is None:
        return Step.SKIP
    count, rest = divmod(8 * wanted - head, width)
    if count != len(sending.values[name]):
        case.answer.also = (*case.answer.also, *_COUNTS)
    sending.payload = sending.payload[:wanted].ljust(wanted, b"\0")
    case.say(
        f"payload of {wanted} bytes instead of {size}: {name} has {count} elements of {width} bits and {rest} bits"
    )
    return Step.DONE


def _crowded(case: Case, sending: Sending) -> Step:
    found = tail(sending.message)
    if found is None:
        return Step.SKIP
    _, name, array = found
    elements = list(sending.values[name])
    count, more = len(elements), int(case.options["more"])
    if not 1 <= more <= _MOST or not (elements or isinstance(array.element, PrimitiveType)):
        return Step.SKIP
    filler = 0 if isinstance(array.element, PrimitiveType) else elements[-1]
    wanted = array.max + more
    sending.values = {**sending.values, name: elements + [filler] * (wanted - count)}
    sending.damaged = True
    case.say(f"{name} has {wanted} elements instead of {count}; it may have {array.max}")
    return Step.DONE


FAULTS: tuple[Fault, ...] = (
    Fault("TYP-001", "a payload is shorter than its type", transfer=_short, fits=telemetry, options={"bytes": 1}),
    Fault("TYP-002", "a payload is longer than its type", transfer=_long, fits=telemetry, options={"bytes": 1}),
    Fault(
        "TYP-003",
        "padding bits are not zero",
        transfer=_padding,
        fits=_padded,
        options={"bits": 1},
        also=("TYP-010",),
        harmless=True,
    ),
    Fault("TYP-004", "a length that holds no whole number of elements", transfer=_uneven, fits=_odd),
    Fault(
        "TYP-005",
        "an array has more elements than it may",
        values=_crowded,
        fits=_ends_in_array,
        options={"more": 1},
        also=("TYP-002", "TYP-004", "TYP-103", "BUS-027", "PUSH-004"),
    ),
)
