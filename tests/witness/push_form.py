"""Proofs of PUSH-001 to PUSH-011: headers, lengths, checksums, counts, byte order and units of packets.

They look at the data of PUSHSCI and PUSHCAN as pieces, whatever is wrong with them: where one begins, what it claims,
what it has.
"""

from __future__ import annotations

import struct
from collections import defaultdict
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from kit import encode

from witness.views import MILLISECOND, Finder, Found, Latest, Message, by_node, messages, prefixed

if TYPE_CHECKING:
    from collections.abc import Callable

    from witness.reader import Log

UNITS = range(0xA1, 0xAA)
SET = "PUSHSCI.FocParameters"
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


def _pieces(wrong: Callable[[Piece], bool]) -> Finder:
    return lambda log: [piece.numbers for piece in pieces(log) if wrong(piece)]


def unknown_id(piece: Piece) -> bool:
    """PUSH-007: a header that is known, and a frame ID that its direction does not have."""
    return bool(piece.direction) and piece.frame_id >= 0 and not piece.name


def wrong_length(piece: Piece) -> bool:
    """PUSH-003: the length is not that of the table of its frame ID."""
    return bool(piece.name) and piece.length >= 0 and piece.length != SIZES[piece.name]


def wrong_sum(piece: Piece) -> bool:
    """PUSH-005: the last byte is not the sum of those before, for FocParameters not that of bytes 1..28 either."""
    if not piece.direction or not 7 <= piece.size <= len(piece.data) or piece.summed():
        return False
    return piece.name != SET or not piece.summed(28)


def other_range(piece: Piece) -> bool:
    """PUSH-006: FocParameters whose checksum is that of bytes 1..28 and not that of 1..30, which is expected."""
    return piece.name == SET and piece.sound and not piece.summed()


def wrong_unit(piece: Piece) -> bool:
    """PUSH-008: a unit other than 0xA1..0xA9; 0xFF is good in FocQuery."""
    allowed = piece.unit in UNITS or (piece.name == "PUSHSCI.FocQuery" and piece.unit == 0xFF)
    return bool(piece.direction) and piece.unit >= 0 and not allowed


def counts(log: Log) -> Found:
    """PUSH-009: a count that does not follow on the last of its node, direction and unit.

    Where more of the node follow on with a count for each frame ID, for the node, or for each frame ID of the node,
    those that then do not.
    """
    rows: dict[tuple[int, str], list[Piece]] = defaultdict(list)
    for piece in pieces(log):
        if piece.direction and piece.unit >= 0:
            rows[piece.src, piece.direction].append(piece)
    found = []
    for row in rows.values():
        readings = (
            _steps(row, lambda piece: piece.unit),
            _steps(row, lambda piece: (piece.unit, piece.frame_id)),
            _steps(row, lambda _: 0),
            _steps(row, lambda piece: piece.frame_id),
        )
        best = max(readings, key=lambda steps: sum(step == 1 for step, _ in steps))
        found += [piece.numbers for step, piece in best if step != 1]
    return found


def _steps(row: list[Piece], shared: Callable[[Piece], object]) -> list[tuple[int, Piece]]:
    """How far the count went on, modulo 256, and the later packet of each two that share it."""
    apart: dict[object, list[Piece]] = defaultdict(list)
    for piece in row:
        apart[shared(piece)].append(piece)
    return [((piece.count - before.count) % 256, piece) for own in apart.values() for before, piece in pairwise(own)]


def near(a: float, b: float, share: float) -> bool:
    """Do two readings of one quantity agree? Both are rounded, to a hundredth or by float16 to a thousandth of it."""
    size = max(abs(a), abs(b))
    return abs(a - b) <= share * size + 0.02 + 0.001 * size


def big_endian(log: Log) -> Found:
    """PUSH-010: voltage and speed read big-endian agree with the node's ESCStatus, read little-endian they do not."""
    statuses = {src: Latest(sent) for src, sent in by_node(log, "ESCStatus").items()}
    found = []
    for piece, little in packets(log, "PUSHCAN.MotorStatus"):
        status = statuses[piece.src].nearest(piece.t, 100 * MILLISECOND) if piece.src in statuses else None
        if status is None:
            continue
        big = piece.read(">")
        if _agrees(big, status) and not _agrees(little, status):
            found.append(piece.numbers)
    return found


def _agrees(values: dict[str, int], status: Message) -> bool:
    return near(values["voltage"] / 100, status["voltage"], 0.02) and near(values["speed"], status["rpm"], 0.05)


def units(log: Log) -> Found:
    """PUSH-011: unit 0xA1 + k from a node whose esc_index is not k.

    Where both are one number, the map is the one that positions suggest, and the rule's note is no oddity.
    """
    statuses = {src: Latest(sent) for src, sent in by_node(log, "ESCStatus").items()}
    found = []
    for piece in pieces(log):
        if piece.carried.name != "PUSHCAN" or not piece.sound or piece.src not in statuses:
            continue
        status = statuses[piece.src].nearest(piece.t, 1000 * MILLISECOND)
        if status is not None and piece.unit - 0xA1 != status["esc_index"]:
            found.append(piece.numbers)
    return found


FINDERS: dict[str, Finder] = {
    "PUSH-001": _pieces(lambda piece: not piece.direction),
    "PUSH-002": _pieces(lambda piece: piece.direction not in {"", piece.carried.name}),
    "PUSH-003": _pieces(wrong_length),
    "PUSH-004": _pieces(lambda piece: bool(piece.direction) and len(piece.data) != piece.length),
    "PUSH-005": _pieces(wrong_sum),
    "PUSH-006": _pieces(other_range),
    "PUSH-007": _pieces(unknown_id),
    "PUSH-008": _pieces(wrong_unit),
    "PUSH-009": counts,
    "PUSH-010": big_endian,
    "PUSH-011": units,
}
