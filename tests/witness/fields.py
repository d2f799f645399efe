"""Payloads as values, the inverse of `encode.encode` and `encode.packet`; what is missing or left over is told."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import Any

from kit import encode


class Float(float):
    """A floating point number that keeps the raw `code` it was read from, and its `width` in bits."""

    code: int
    width: int


@dataclass(slots=True)
class Fields:
    """`values` by name as `encode.encode` takes them, as far as they are complete.

    `rest` are the bits behind the last field, "" if none; `missing` says that the payload ended too early; `voids` are
    the values of the void fields in order; `tag` is a union's tag that names no member.
    """

    values: dict[str, Any]
    rest: str = ""
    missing: bool = False
    voids: list[int] = field(default_factory=list)
    tag: int | None = None


class _OutOfBitsError(Exception):
    pass


class _OutOfTagsError(Exception):
    pass


class _Bits:
    def __init__(self, data: bytes) -> None:
        self.bits = "".join(f"{byte:08b}" for byte in data)
        self.at = 0
        self.voids: list[int] = []
        self.tag: int | None = None

    @property
    def left(self) -> int:
        return len(self.bits) - self.at

    def number(self, width: int) -> int:
        """Whole low-order bytes first, then the high bits that remain."""
        if width > self.left:
            raise _OutOfBitsError
        value = 0
        for low in range(0, width, 8):
            size = min(8, width - low)
            value |= int(self.bits[self.at : self.at + size], 2) << low
            self.at += size
        return value

    def scalar(self, base: str) -> int | Float:
        width = int(base[1:])
        raw = self.number(width)
        if base[0] == "f":
            code = {16: "<e", 32: "<f", 64: "<d"}[width]
            value = Float(struct.unpack(code, raw.to_bytes(width // 8, "little"))[0])
            value.code, value.width = raw, width
            return value
        return raw - (1 << width) if base[0] == "i" and raw >> width - 1 else raw

    def record(self, layout: str, tail: bool, into: dict[str, Any]) -> None:
        union, fields = encode.parse(layout)
        if union:
            tag = self.number((len(fields) - 1).bit_length())
            if tag >= len(fields):
                self.tag = tag
                raise _OutOfTagsError
            fields = fields[tag : tag + 1]
        for at, (name, base, size, how) in enumerate(fields):
            last = tail and (union or at == len(fields) - 1)
            if base[0] == "v":
                self.voids.append(self.number(int(base[1:])))
            elif how:
                items = into[name] = []
                self.array(base, size, how == "dynamic", last, items)
            else:
                self.item(base, last, into, name)

    def array(self, base: str, size: int, dynamic: bool, last: bool, items: list[Any]) -> None:
        if dynamic and last and encode.min_bits(base) >= 8:
            while self.left >= encode.min_bits(base):
                items.append(None)
                self.item(base, False, items, -1)
            return
        count = self.number(size.bit_length()) if dynamic else size
        for at in range(count):
            items.append(None)
            self.item(base, last and at == count - 1, items, -1)

    def item(self, base: str, last: bool, into: Any, at: int | str) -> None:
        if base in encode.RECORDS:
            into[at] = {}
            self.record(encode.RECORDS[base], last, into[at])
        else:
            into[at] = self.scalar(base)


def unpack(name: str, payload: bytes, fd: bool = False) -> Fields:
    """The fields of a type of `encode.TYPES`; on CAN FD the last array keeps its length."""
    bits, values = _Bits(payload), {}
    try:
        bits.record(encode.TYPES[name].layout, not fd, values)
    except _OutOfBitsError:
        return Fields(values, "", missing=True, voids=bits.voids)
    except _OutOfTagsError:
        return Fields(values, bits.bits[bits.at :], voids=bits.voids, tag=bits.tag)
    return Fields(values, bits.bits[bits.at :], voids=bits.voids)


@dataclass(frozen=True, slots=True)
class Packet:
    """One packet as it stands in the data of PUSHSCI or PUSHCAN, `offset` bytes from the start.

    `name` as in `encode.PACKETS`, or "" for bytes that no packet claims. `length` and `check` are the packet's own
    fields; `values` are raw.
    """

    name: str
    offset: int
    data: bytes
    values: dict[str, Any] = field(default_factory=dict)

    @property
    def header(self) -> bytes:
        return self.data[:2]

    @property
    def frame_id(self) -> int:
        return self.data[2]

    @property
    def count(self) -> int:
        return self.data[3]

    @property
    def unit(self) -> int:
        return self.data[4]

    @property
    def length(self) -> int:
        return self.data[5]

    @property
    def check(self) -> int:
        return self.data[-1]

    def summed(self, end: int | None = None) -> bool:
        """Is the last byte the sum of bytes 1 to `end` (all but itself by default)?"""
        return sum(self.data[: len(self.data) - 1 if end is None else end]) & 0xFF == self.check


def packets(carrier: str, data: bytes) -> list[Packet]:
    """The packets in the data of `carrier` (PUSHSCI, PUSHCAN), one behind the other, with sizes by their frame ID.

    From the first byte where no packet of that direction stands whole, the rest is one piece without a name.
    """
    found, at = [], 0
    by_id = {number: name for name, (number, _) in encode.PACKETS.items() if name.startswith(carrier)}
    while at < len(data):
        name = (
            by_id.get(data[at + 2], "") if data[at : at + 2] == encode.HEADERS[carrier] and at + 2 < len(data) else ""
        )
        pairs = [word.split(":") for word in encode.PACKETS[name][1].split()] if name else []
        codes = "<" + "".join(code for _, code in pairs)
        end = at + 7 + struct.calcsize(codes)
        if not name or end > len(data):
            return [*found, Packet("", at, data[at:])]
        values = struct.unpack_from(codes, data, at + 6)
        found.append(Packet(name, at, data[at:end], dict(zip((n for n, _ in pairs), values, strict=True))))
        at = end
    return found
