"""Common ground of the rules of packets: the forms of 4.4.4 and 4.4.5, and the bytes that a message carries."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from dissectors.kit import SECOND, breach, groups, sender
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from dissectors.kit import Array, DecodedTable, Occurrence, Values, View

HEADERS = {"PUSHSCI": b"\xec\x96", "PUSHCAN": b"\x7b\x8c"}
CARRIER_OF = {header: name for name, header in HEADERS.items()}
TYPE_IDS = {"PUSHSCI": 1038, "PUSHCAN": 1039}
# Frame ID and length by packet, and the same by the carrier whose header they belong to.
FORMS = {
    "SetZero": (0x08, 7),
    "FocParameters": (0x1E, 31),
    "FocQuery": (0x1A, 7),
    "OutputControl": (0x06, 12),
    "MotorStatus": (0x15, 28),
    "FocFeedback": (0x1E, 55),
}
_PACKETS = sorted(f"{carrier}.{packet}" for carrier in HEADERS for packet in FORMS)
KNOWN_IDS = {"PUSHSCI": frozenset({0x06, 0x08, 0x1A, 0x1E}), "PUSHCAN": frozenset({0x15, 0x1E})}
ALL_UNITS = 0xFF
FIRST_UNIT, LAST_UNIT = 0xA1, 0xA9
NO_CHANGE_8, NO_CHANGE_16 = 0xFF, 0xFFFF  # in a set packet
UNRECOGNIZED = "unrecognized"
LONGEST = 2 * SECOND  # from a transfer's first frame to its last: until then a row of that time may still come


def carrier(table: DecodedTable) -> str:
    """Return the message that carried the packets of a table."""
    return table.name.partition(".")[0]


def packet(table: DecodedTable) -> str:
    """Return the name of a table's packets."""
    return table.name.partition(".")[2]


def packet_tables(view: View) -> Iterator[DecodedTable]:
    """Yield the tables of all packets that the document knows, whatever carried them."""
    for name in _PACKETS:
        if (table := view.table(name)) is not None:
            yield table


def unit_key(table: DecodedTable) -> Array:
    """Return bus, source node and power unit of each row as one number; not to be written to."""
    return table.once(_unit_key)


def _unit_key(table: DecodedTable) -> Array:
    return sender(table).astype(np.int64) << 8 | table["unit_id"]


def by_unit(table: DecodedTable, rows: Array) -> Iterator[tuple[tuple[int, int, int], Array]]:
    """Yield bus, source node and power unit, and which of the rows are theirs, in order."""
    for key, places in groups(unit_key(table)[rows]):
        yield (key >> 15, key >> 8 & 0x7F, key & 0xFF), rows[places]


def sender_key(table: DecodedTable) -> Array:
    """Return bus and source node of each row as one number; not to be written to."""
    return table.once(_sender_key)


def _sender_key(table: DecodedTable) -> Array:
    return sender(table).astype(np.int64)


def occurrence(view: View, table: DecodedTable, row: int, rule: str, values: Values, **about: Any) -> Occurrence:
    """Return a breach in one row of a packet's or a carrier's table; it is said of the carrier."""
    return breach(view, table, row, rule, values, type=carrier(table), **about)


def place(table: DecodedTable) -> Array:
    """Return each row's place in the order of the capture: transfer, then byte of its data; not to be written to."""
    return table.once(_place)


def _place(table: DecodedTable) -> Array:
    return table["transfer"].astype(np.int64) << 16 | table["offset"].astype(np.int64)


@dataclass(frozen=True, slots=True)
class CarriedPiece:
    """Bytes of one message's data from a header, or from its first byte, up to the next header.

    `direction` is the carrier that the header belongs to, "" without a header. `last` says that no header follows.
    """

    offset: int
    direction: str
    data: bytes
    last: bool = True

    @property
    def frame_id(self) -> int | None:
        """Byte 3, None if the data ends before it."""
        return self._byte(2)

    @property
    def unit(self) -> int | None:
        """Byte 5."""
        return self._byte(4)

    @property
    def length(self) -> int | None:
        """Byte 6: how long the packet says it is."""
        return self._byte(5)

    @property
    def named(self) -> bool:
        """True if the document has a packet of this direction and frame ID."""
        return bool(self.direction) and self.frame_id in KNOWN_IDS[self.direction]

    def _byte(self, at: int) -> int | None:
        return self.data[at] if at < len(self.data) else None


class Carried:
    """The data of one batch's PUSHSCI or PUSHCAN, and where the packets found in it begin."""

    def __init__(self, view: View, name: str) -> None:
        self.name = name
        self._table = view.table(name)
        self._parts = [part for tail in (*FORMS, UNRECOGNIZED) if (part := view.table(f"{name}.{tail}")) is not None]
        self._lists: tuple[Array, Array] | None = None

    def data(self, row: int) -> bytes:
        """Return what the message in a row of the batch's transfers carries, without a length in front."""
        if self._table is None:
            return b""
        if self._lists is None:
            self._lists = self._table.lists("data")
        starts, values = self._lists
        at = int(self._table.row.searchsorted(row))
        return bytes(values[starts[at] : starts[at + 1]])

    def pieces(self, row: int) -> list[CarriedPiece]:
        """Return the data of a message cut at its headers; what has none and follows a packet belongs to it."""
        data, offsets = self.data(row), self._offsets(row)
        found: list[CarriedPiece] = []
        for start, end in zip(offsets, [*offsets[1:], len(data)], strict=True):
            direction = CARRIER_OF.get(data[start : start + 2], "")
            if direction or not found:
                found.append(CarriedPiece(start, direction, data[start:end], last=end == len(data)))
            else:
                before = found.pop()
                whole = before.data + data[start:end]
                found.append(CarriedPiece(before.offset, before.direction, whole, last=end == len(data)))
        return found

    def _offsets(self, row: int) -> list[int]:
        found: list[int] = []
        for part in self._parts:
            low, high = part.row.searchsorted([row, row + 1])
            found += map(int, part["offset"][low:high])
        return sorted(found)


def hexadecimal(data: Sequence[int]) -> str:
    """Return bytes as people write them."""
    return bytes(data).hex(" ").upper()
