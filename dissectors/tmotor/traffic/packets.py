"""Packets inside PUSHSCI and PUSHCAN (4.4.4, 4.4.5), built, read and changed as raw field values.

Names of packets and fields are those of the DSDL files in `packets/`, which also give the layouts.
"""

from __future__ import annotations

import struct
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from dissectors.profile import Profile
from dissectors.records import dataclass
from dissectors.schema import ArrayType, PrimitiveType

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dissectors.schema import CompoundType, Packet, PacketFamily

# The raw value of a field: a number, or the bytes of an array.
Raw = int | bytes
# All units, in a FocQuery (4.4.4 table 3 no 5).
EVERY_UNIT = 0xFF

_FOLDER = Path(__file__).resolve().parent.parent
_CODES = {("uint", 8): "B", ("int", 8): "b", ("uint", 16): "H", ("int", 16): "h", ("uint", 32): "I", ("int", 32): "i"}


@dataclass(frozen=True, slots=True)
class PacketForm:
    """How one packet is laid out: the names of its fields and their places, in either byte order."""

    packet: Packet
    family: PacketFamily
    names: tuple[str, ...]
    little: struct.Struct
    big: struct.Struct

    def pack(self, values: Mapping[str, Raw], *, big_endian: bool) -> bytes:
        """Pack every field in order; what `values` leaves out is zero."""
        if unknown := values.keys() - set(self.names):
            raise KeyError(*sorted(unknown))
        order = self.big if big_endian else self.little
        return order.pack(*(_fitting(values.get(name, 0), at) for name, at in zip(self.names, self.parts, strict=True)))

    @property
    def parts(self) -> tuple[bool, ...]:
        """Which fields are arrays."""
        return tuple(isinstance(member.type, ArrayType) for member in self.packet.layout.fields)


def packet(
    name: str,
    count: int,
    unit: int,
    values: Mapping[str, Raw] | None = None,
    *,
    sum_end: int | None = None,
    big_endian: bool = False,
) -> bytes:
    """Return one packet, header and checksum included.

    `name` is MotorStatus, FocFeedback, SetZero, FocParameters, FocQuery or OutputControl; `unit` is 0xA1 to 0xA9, or
    `EVERY_UNIT`. Fields that `values` leaves out are zero. The checksum covers bytes 1 to `sum_end`, by default all
    before it. Raises `KeyError` for a field that it has not.
    """
    form = _by_name()[name]
    head: dict[str, Raw] = {
        "header": form.family.header,
        "frame_id": form.packet.id,
        "frame_count": count % 256,
        "unit_id": unit,
        "length": form.packet.length,
    }
    return _summed(form.pack({**head, **(values or {})}, big_endian=big_endian), sum_end)


def split(data: bytes, *, big_endian: bool = False) -> tuple[str, dict[str, Raw]]:
    """Return name and raw values of the one packet in `data`.

    Raises `ValueError` if it is none of the document's: header, frame ID or size is another.
    """
    form = _of(data)
    order = form.big if big_endian else form.little
    return form.packet.name, dict(zip(form.names, order.unpack(data), strict=True))


def change(
    data: bytes,
    *,
    resum: bool = True,
    sum_end: int | None = None,
    big_endian: bool = False,
    **changes: Raw,
) -> bytes:
    """Return the packet with other raw values, of its header too (`header`, `frame_id`, `frame_count` ...).

    The checksum is made anew over bytes 1 to `sum_end` (by default all before it) unless `resum` is off or `checksum`
    is among the changes. Raises `ValueError` like `split`, and `KeyError` for a name that the packet has not.
    """
    form = _of(data)
    _, values = split(data, big_endian=big_endian)
    changed = form.pack({**values, **changes}, big_endian=big_endian)
    return _summed(changed, sum_end) if resum and "checksum" not in changes else changed


def sound(data: bytes) -> bool:
    """Return if length byte and checksum are right; a packet of two possible ranges may use either.

    Raises `ValueError` like `split`.
    """
    form = _of(data)
    right = any(sum(data[:end]) & 0xFF == data[-1] for end in form.packet.checksum_ends)
    return right and data[form.family.length_at] == form.packet.length


def _summed(data: bytes, end: int | None) -> bytes:
    return data[:-1] + bytes((sum(data[: len(data) - 1 if end is None else end]) & 0xFF,))


def _fitting(value: Raw, array: bool) -> Raw:
    """Return the value, or an empty array for one left out: the format fills it with zeros."""
    return b"" if array and isinstance(value, int) else value


def _of(data: bytes) -> PacketForm:
    for form in _by_name().values():
        family = form.family
        if data.startswith(family.header) and len(data) == form.packet.length and data[family.id_at] == form.packet.id:
            return form
    raise ValueError(f"no packet of the document: {data[:6].hex(' ')}, {len(data)} bytes")


@cache
def _by_name() -> dict[str, PacketForm]:
    return {
        packet.name: _form(packet, carrier.packets)
        for carrier in Profile.open(_FOLDER).having("packets")
        if carrier.packets is not None
        for packet in carrier.packets.packets
    }


def _form(packet: Packet, family: PacketFamily) -> PacketForm:
    codes = _format(packet.layout)
    names = tuple(member.name for member in packet.layout.fields)
    return PacketForm(packet, family, names, struct.Struct("<" + codes), struct.Struct(">" + codes))


def _format(layout: CompoundType) -> str:
    """Return the layout in the letters of `struct`; byte arrays are strings of bytes."""
    codes = []
    for member in layout.fields:
        kind = member.type
        if isinstance(kind, ArrayType):
            codes.append(f"{kind.max}s")
        elif isinstance(kind, PrimitiveType):
            codes.append(_CODES[kind.kind, kind.bits])
    return "".join(codes)
