"""What the proofs about values look at: payloads as values, the inverse of `encode.encode`, and transfers with them.

What is missing from a payload or left over is told.
"""

from __future__ import annotations

import struct
from bisect import bisect_left, bisect_right
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from kit import encode

from witness.reader import Log, Transfer

Found = list[set[int]]  # each finding: the numbers of the frames that show it
Finder = Callable[[Log], Found]

SECOND = 10**9
MILLISECOND = 10**6


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


@dataclass(frozen=True, slots=True, eq=False)
class Message:
    """A transfer that arrived whole, with the values that its payload has."""

    transfer: Transfer
    payload: bytes
    fields: Fields

    @property
    def name(self) -> str:
        return self.transfer.name

    @property
    def src(self) -> int:
        return self.transfer.first.src

    @property
    def t(self) -> int:
        """When its last frame came."""
        return self.transfer.frames[-1].t

    @property
    def numbers(self) -> set[int]:
        return self.transfer.numbers

    @property
    def values(self) -> dict[str, Any]:
        return self.fields.values

    def __getitem__(self, name: str) -> Any:
        return self.fields.values[name]


@lru_cache(maxsize=64)
def everything(log: Log) -> tuple[Message, ...]:
    """All transfers of known types whose CRC is right, in the order of their first frames."""
    whole = [one for one in log.transfers if one.name and one.status == "ok"]
    return tuple(Message(one, one.payload, unpack(one.name, one.payload, one.first.fd)) for one in whole)


@lru_cache(maxsize=256)
def messages(log: Log, *names: str) -> tuple[Message, ...]:
    """Those of some types that hold every field."""
    return tuple(one for one in everything(log) if one.name in names and not one.fields.missing)


def where(log: Log, names: tuple[str, ...], wrong: Callable[[Message], bool]) -> Found:
    """The transfers of some types that are wrong."""
    return [one.numbers for one in messages(log, *names) if wrong(one)]


def prefixed(one: Message) -> bool:
    """Does a length that classic CAN leaves out stand before its last array (TYP-006)?"""
    if one.transfer.first.fd:
        return False
    payload = one.payload
    if one.name in encode.HEADERS:
        return payload[4:5] == bytes([len(payload) - 5 & 0xFF]) and payload[5:7] in encode.HEADERS.values()
    if one.name == "ParamGet" and len(payload) == 74:
        return payload[41] == 32 or (payload[41] >> 2 == 32 and not payload[73] & 3)
    if one.name == "RawCommand" and len(payload) == 36:
        bits = "".join(f"{byte:08b}" for byte in payload)
        narrow = int(bits[:5], 2) == 20 and not int(bits[285:], 2)
        return payload[0] == 20 or narrow
    return False


class Latest:
    """Looks up what was sent around a time, in messages in the order of their ends."""

    def __init__(self, sent: list[Message]) -> None:
        self.sent = sorted(sent, key=lambda one: one.t)
        self.times = [one.t for one in self.sent]

    def between(self, start: int, end: int) -> list[Message]:
        """Those that ended from `start` to `end`, both included."""
        return self.sent[bisect_left(self.times, start) : bisect_right(self.times, end)]

    def nearest(self, t: int, within: int) -> Message | None:
        """The one that ended nearest to `t`, `within` ns."""
        near = self.between(t - within, t + within)
        return min(near, key=lambda one: abs(one.t - t)) if near else None


def by_node(log: Log, name: str) -> dict[int, list[Message]]:
    """The messages of a type, by the node that sent them."""
    found: dict[int, list[Message]] = {}
    for one in messages(log, name):
        found.setdefault(one.src, []).append(one)
    return found
