"""Values to the bits of a payload, after the layout that DSDL gives: a sender's half, compiled once a type."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Any

from dissectors.layout import ArrayType, CompoundType, PrimitiveType
from dissectors.traffic import Code

if TYPE_CHECKING:
    from collections.abc import Callable

    from dissectors.layout import Type

    # Takes the value and the bits so far (a number and its width), gives both with the value behind them.
    Write = Callable[[Any, int, int], tuple[int, int]]

_FLOATS = {16: ("<e", 65504.0), 32: ("<f", 3.4028234663852886e38), 64: ("<d", 1.7976931348623157e308)}


def compiled(layout: CompoundType) -> Callable[[dict[str, Any]], bytes]:
    """Return a function: values of one message to its payload on classic CAN, zero bits filling the last byte."""
    write = _compound(layout, tail=True)

    def payload(values: dict[str, Any]) -> bytes:
        bits, width = write(values, 0, 0)
        spare = -width % 8
        return (bits << spare).to_bytes((width + spare) // 8, "big")

    return payload


def float_code(value: float, bits: int) -> int:
    """Return the code of a float, out-of-range numbers saturated as DroneCAN asks; infinity and NaN stay."""
    if isinstance(value, Code):
        return int(value)
    form, largest = _FLOATS[bits]
    if value - value == 0:  # finite
        value = min(max(value, -largest), largest)
    return int.from_bytes(struct.pack(form, value), "little")


def _type(layout: Type, *, tail: bool) -> Write:
    if isinstance(layout, PrimitiveType):
        return _primitive(layout)
    if isinstance(layout, ArrayType):
        return _array(layout, tail=tail)
    return _compound(layout, tail=tail)


def _compound(layout: CompoundType, *, tail: bool) -> Write:
    last = len(layout.fields) - 1
    writes = [
        (member.name, _type(member.type, tail=tail and (layout.union or at == last)))
        for at, member in enumerate(layout.fields)
    ]
    if layout.union:
        return _union(layout, writes)

    def write(value: Any, bits: int, width: int) -> tuple[int, int]:
        for name, inner in writes:
            bits, width = inner(value[name] if name else 0, bits, width)
        return bits, width

    return write


def _union(layout: CompoundType, writes: list[tuple[str, Write]]) -> Write:
    tag_bits = layout.tag_bits
    tags = {name: (tag, inner) for tag, (name, inner) in enumerate(writes)}

    def write(value: Any, bits: int, width: int) -> tuple[int, int]:
        ((name, inside),) = value.items()
        tag, inner = tags[name]
        return inner(inside, bits << tag_bits | tag, width + tag_bits)

    return write


def _array(layout: ArrayType, *, tail: bool) -> Write:
    bare = tail and layout.dynamic and layout.element.min_bits >= 8
    length_bits = 0 if bare else layout.length_bits
    length = _integer(length_bits) if length_bits else None
    item = _type(layout.element, tail=False)
    last = _type(layout.element, tail=tail and not bare)
    octets = bare and isinstance(layout.element, PrimitiveType) and layout.element.bits == 8

    def write(value: Any, bits: int, width: int) -> tuple[int, int]:
        if octets:
            whole = bytes(value)
            return bits << 8 * len(whole) | int.from_bytes(whole, "big"), width + 8 * len(whole)
        if length is not None:
            bits, width = length(len(value), bits, width)
        for one in value[:-1]:
            bits, width = item(one, bits, width)
        return last(value[-1], bits, width) if len(value) else (bits, width)

    return write


def _primitive(layout: PrimitiveType) -> Write:
    if layout.kind != "float":
        return _integer(layout.bits)
    size = layout.bits
    whole = _integer(size)
    return lambda value, bits, width: whole(float_code(value, size), bits, width)


def _integer(size: int) -> Write:
    """Write whole low-order bytes first, then what remains of the high bits."""
    count, rest = divmod(size, 8)
    mask, full = (1 << size) - 1, 8 * count

    def write(value: Any, bits: int, width: int) -> tuple[int, int]:
        number = int(value) & mask
        if count == 1:
            bits = bits << 8 | number & 0xFF
        elif count:
            bits = bits << full | int.from_bytes((number & (1 << full) - 1).to_bytes(count, "little"), "big")
        return bits << rest | number >> full, width + size

    return write
