"""A length in front of an array that needs none on classic CAN (TYP-006), as the maxima of table 4.3.1 count it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dissectors.layout import ArrayType
from dissectors.tmotor.traffic.faults.occasions import chosen, provoke
from dissectors.traffic import Fault, Step

if TYPE_CHECKING:
    from dissectors.traffic import Case, Sending

# These two show a length only when they are as long as they can be: 36 and 74 bytes.
_FULL: dict[str, tuple[str, ...]] = {"RawCommand": ("TYP-103", "BUS-027"), "ParamGet": ()}


def _prefixed(case: Case, sending: Sending) -> Step:
    """Put the length in as one byte or, in the `form` dsdl, as the bits that DSDL gives it."""
    message, payload = sending.message, sending.payload
    array = message.layout.fields[-1].type
    if not isinstance(array, ArrayType) or not array.dynamic:
        return Step.SKIP
    head = message.min_bytes
    body = payload[head:]
    count = 8 * len(body) // array.element.max_bits
    if message.table in _FULL:
        body, count = body.ljust(message.max_bytes - head, b"\0"), array.max
    width = array.length_bits if case.options["form"] == "dsdl" else 8
    bits = array.element.max_bits * count
    number = count << bits | int.from_bytes(body, "big") >> 8 * len(body) - bits
    spare = -(width + bits) % 8
    sending.payload = payload[:head] + (number << spare).to_bytes((width + bits + spare) // 8, "big")
    case.say(
        f"the length of {count} elements in {width} bits behind byte {head}: "
        f"{len(sending.payload)} bytes instead of {len(payload)}"
    )
    return Step.DONE


def _prefix(case: Case) -> None:
    name = str(case.options.get("type", "PUSHCAN"))
    case.answer.also = _FULL.get(name, ())
    provoke(case, name, "transfer", _prefixed, chosen(case, packets=True))


FAULTS: tuple[Fault, ...] = (
    Fault(
        "TYP-006",
        "a length in front of an array that needs none",
        start=_prefix,
        options={"form": "byte"},
        choices={"form": ("byte", "dsdl")},
    ),
)
