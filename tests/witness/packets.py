"""Data of PUSHSCI and PUSHCAN as pieces, whatever is wrong with them: where one begins, what it claims, what it has."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from kit import encode

from witness.views import Message, messages, prefixed

if TYPE_CHECKING:
    from witness.reader import Log

CARRIERS = {header: name for name, header in encode.HEADERS.items()}
_BY_ID = {(name[:7], number): name for name, (number, _) in encode.PACKETS.items()}


def _codes(name: str) -> list[tuple[str, str]]:
    return [tuple(word.split(":")) for word in encode.PACKETS[name][1].split()]


_FORMS = {name: "".join(code for _, code in _codes(name)) for name in encode.PACKETS}
SIZES = {name: 7 + struct.calcsize("<" + form) for name, form in _FORMS.items()}


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """Bytes of the data of one PUSHSCI or PUSHCAN: a packet with all that follows it up to the next, or no packet.

    `direction` is the carrier that its header belongs to, "" without a header that is known.
    """

    carried: Message
    direction: str
    data: bytes

    @property
    def src(self) -> int:
        return self.carried.src

    @property
    def t(self) -> int:
        return self.carried.t

    @property
    def numbers(self) -> set[int]:
        return self.carried.numbers

    @property
    def name(self) -> str:
        """As in `encode.PACKETS`, by the header's direction and the frame ID; "" if there is none."""
        return _BY_ID.get((self.direction, self.frame_id), "")

    @property
    def frame_id(self) -> int:
        return self.data[2] if len(self.data) > 2 else -1

    @property
    def count(self) -> int:
        return self.data[3] if len(self.data) > 3 else -1

    @property
    def unit(self) -> int:
        return self.data[4] if len(self.data) > 4 else -1

    @property
    def length(self) -> int:
        """As the packet says."""
        return self.data[5] if len(self.data) > 5 else -1

    @property
    def size(self) -> int:
        """By the table of its frame ID; of an unknown one, as the packet says."""
        return SIZES.get(self.name, self.length)

    def summed(self, end: int | None = None) -> bool:
        """Is the last byte the sum of bytes 1 to `end` (all before it by default)?"""
        return sum(self.data[: self.size - 1 if end is None else end]) & 0xFF == self.data[self.size - 1]

    @property
    def sound(self) -> bool:
        """A packet of its carrier's direction, of the right length, with a checksum that is right in either reading."""
        if not self.name or self.direction != self.carried.name or not self.size == self.length <= len(self.data):
            return False
        return self.summed() or (self.name == "PUSHSCI.FocParameters" and self.summed(28))

    def read(self, order: str = "<") -> dict[str, Any]:
        """Its fields, little-endian or (">") big-endian."""
        values = struct.unpack_from(order + _FORMS[self.name], self.data, 6)
        return dict(zip((name for name, _ in _codes(self.name)), values, strict=True))


@lru_cache(maxsize=64)
def pieces(log: Log) -> tuple[Piece, ...]:
    """Everything that PUSHSCI and PUSHCAN carry, in order."""
    found = []
    for one in messages(log, *encode.HEADERS):
        data = one.payload[5:] if prefixed(one) else bytes(one["data"])
        found += [Piece(one, direction, part) for direction, part in split(data)]
    return tuple(found)


def split(data: bytes) -> list[tuple[str, bytes]]:
    """(direction, bytes) of every piece; a piece begins with a header, or is what stands before the next header."""
    found, at = [], 0
    while at < len(data):
        direction = CARRIERS.get(data[at : at + 2], "")
        end = _end(direction, data, at)
        found.append((direction, data[at:end]))
        at = end
    return found


def _end(direction: str, data: bytes, at: int) -> int:
    """Where the next piece begins: by its length or by its table, if a header or nothing follows there."""
    if not direction:
        places = [data.find(header, at + 1) for header in CARRIERS]
        return min((place for place in places if place > 0), default=len(data))
    name = _BY_ID.get((direction, data[at + 2] if at + 2 < len(data) else -1), "")
    claimed = data[at + 5] if at + 5 < len(data) else 0
    for size in (claimed, SIZES.get(name, 0)):
        if size >= 7 and (at + size == len(data) or data[at + size : at + size + 2] in CARRIERS):
            return at + size
    return len(data)


def packets(log: Log, name: str) -> list[tuple[Piece, dict[str, Any]]]:
    """The sound packets of a name with their fields."""
    return [(piece, piece.read()) for piece in pieces(log) if piece.name == name and piece.sound]
