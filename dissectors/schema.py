"""The vocabulary of a dissector: frozen data that the loader writes and every reader shares.

Layout (`PrimitiveType`, `ArrayType`, `CompoundType`, from `dissectors.layout`) says where the bits are; it comes from
DSDL alone. Meaning (`Note`, `Bits`, `Derived`, `Packet`, `Reading`) comes from a profile. A `Message` is both, with its
identity on the bus. Scales are fractions, so that a raw value times 1/100 is exact.
"""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, Literal

from dissectors.layout import ArrayType, CompoundType, Member, PlanToken, PrimitiveType, Type, plan, wire_bits
from dissectors.records import dataclass, field

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dissectors.only import Only

__all__ = [
    "Agreement",
    "ArrayType",
    "Bits",
    "CompoundType",
    "Derived",
    "Dissector",
    "Evidence",
    "Measure",
    "Member",
    "Message",
    "MessageKind",
    "Note",
    "Packet",
    "PacketFamily",
    "Piece",
    "PlanToken",
    "PrimitiveType",
    "Reading",
    "Remark",
    "Type",
    "UnitBy",
    "plan",
    "wire_bits",
]

MessageKind = Literal["message", "request", "response"]


@dataclass(frozen=True, slots=True)
class Bits:
    """A named slice of an unsigned field, bit `low` to bit `high` (0 is the least significant bit).

    One bit without an enumeration is a flag. With `scale` the value is raw * scale in `unit`. `low_limit` and
    `high_limit` are raw. `tentative` marks a name that the document does not give for this field. A word that has a
    special value has no parts. `title` is what people call it, by default its name.
    """

    name: str
    low: int
    high: int
    scale: Fraction | None = None
    unit: str = ""
    enum: Mapping[int, str] = field(default_factory=dict)
    clause: str = ""
    tentative: bool = False
    low_limit: Fraction | None = None
    high_limit: Fraction | None = None
    title: str = ""

    @property
    def width(self) -> int:
        """Number of bits."""
        return self.high - self.low + 1

    @property
    def flag(self) -> bool:
        """True for a single bit that is simply set or not."""
        return self.low == self.high and not self.enum and self.scale is None

    @property
    def called(self) -> str:
        """The words for it."""
        return self.title or self.name.replace("_", " ")


@dataclass(frozen=True, slots=True)
class Measure:
    """How to read a value whose unit depends on another field; `high` is the largest legal raw value."""

    scale: Fraction | None
    unit: str
    meaning: str
    high: Fraction | None = None


@dataclass(frozen=True, slots=True)
class UnitBy:
    """The unit follows the raw value of the neighbour `field`; a value that is not in `table` leaves it unspecified."""

    field: str
    table: Mapping[int, Measure]


@dataclass(frozen=True, slots=True)
class Agreement:
    """The number `field` of `message` shows the same quantity as the field of a packet that the same node sends.

    The two agree when they differ by at most the share `within` of the message's value, both physical.
    """

    message: str
    field: str
    within: Fraction


@dataclass(frozen=True, slots=True)
class Note:
    """A profile's note on one DSDL field.

    `name` is the display name (the DSDL name stays valid as an alias; empty means no other name). `scale` makes the
    raw value physical, in `unit`. `special` are raw values that are not numbers ("no change"), outside `enum` and
    outside the limits. `low` and `high` are inclusive limits of the raw value. `text` is a byte array that holds
    characters, up to NUL; `hex` prefers hexadecimal on display.

    Only fields of packets have the last two: a counter that `wraps` starts again at 0 behind its largest raw value, and
    `agrees` is what the field is compared with to find the sender's byte order.
    """

    name: str = ""
    unit: str = ""
    scale: Fraction | None = None
    enum: Mapping[int, str] = field(default_factory=dict)
    special: Mapping[int, str] = field(default_factory=dict)
    parts: tuple[Bits, ...] = ()
    low: Fraction | None = None
    high: Fraction | None = None
    clause: str = ""
    text: bool = False
    hex: bool = False
    unit_by: UnitBy | None = None
    wraps: bool = False
    agrees: Agreement | None = None


@dataclass(frozen=True, slots=True)
class Piece:
    """Adds `add` to a value in `start` <= value < `stop`; None is an open end."""

    start: Fraction | None
    stop: Fraction | None
    add: Fraction


@dataclass(frozen=True, slots=True)
class Derived:
    """A column computed from the raw value of the field `source`, element by element if that is an array.

    Of an array, `element` takes one place, from 0; a row with fewer has no value. Neither has a raw value outside `low`
    to `high`, or one that is listed in the source's `special`. value = raw * scale + offset; then the first of `pieces`
    that holds this value adds to it; where the sender's `reading` is decided, its choice in `by_choice` does instead.
    With `format` "date" the value is the day that the raw number names as YYYYMMDD or, failing that, as Unix seconds;
    neither is certain.
    """

    name: str
    source: str
    scale: Fraction = Fraction(1)
    offset: Fraction = Fraction(0)
    pieces: tuple[Piece, ...] = ()
    unit: str = ""
    clause: str = ""
    format: Literal["", "date"] = ""
    element: int | None = None
    low: Fraction | None = None
    high: Fraction | None = None
    reading: str = ""
    by_choice: Mapping[str, Fraction] = field(default_factory=dict)


BYTE_ORDERS = ("little-endian", "big-endian")  # of the numbers in packets


@dataclass(frozen=True, slots=True)
class Remark:
    """Words behind the summary of a line, for rows that give cause for them.

    The cause is the raw value of `column`, a field or `field.part`: one that is neither `usual` nor a special value of
    the field; a flag that is set; of a word with flags, without a `text`, each flag that is set, by its name. With
    `changes` also another value than the one before, of the same sender and the same value of the field `per`: both
    names are said. `text` is a template, by default the value of the column. Values among the `capitals` stand in
    capital letters. `only` holds it to the nodes that read a doubtful field so. A remark without a column is the `text`
    of rows that have no other.
    """

    column: str
    text: str = ""
    usual: tuple[int, ...] = ()
    capitals: tuple[int, ...] = ()
    changes: bool = False
    per: str = ""
    only: Only | None = None


@dataclass(frozen=True, slots=True)
class Packet:
    """A packet inside a byte array, with a table of its own called `<message>.<name>`.

    `layout` covers all of its `length` bytes, header and checksum included. The last byte is the low byte of the sum of
    bytes 1 to N, where N is one of `checksum_ends`, the preferred one first. `numbers` are the places (first byte from
    0, bytes) of every number of two or more whole bytes: what a sender with the other byte order turns round.
    """

    name: str
    id: int
    length: int
    layout: CompoundType
    notes: Mapping[str, Note]
    derived: tuple[Derived, ...]
    clause: str
    checksum_ends: tuple[int, ...]
    summary: str
    numbers: tuple[tuple[int, int], ...] = ()
    remarks: tuple[Remark, ...] = ()


@dataclass(frozen=True, slots=True)
class PacketFamily:
    """The packets that the byte array `field` of a message carries; `*_at` are 0-based byte offsets inside a packet."""

    field: str
    header: bytes
    id_at: int
    count_at: int
    unit_at: int
    length_at: int
    packets: tuple[Packet, ...]


@dataclass(frozen=True, slots=True)
class Evidence:
    """Evidence for one `choice` of a reading, judged on the rows of one node.

    Either a value: `field` (or `field.part`, raw) lies in `low` <= value < `stop`, in at least one row, or if
    `every`, in all rows that hold a finite value. Or `sends`: the node sends one of these messages.
    """

    choice: str
    field: str = ""
    low: Fraction | None = None
    stop: Fraction | None = None
    every: bool = False
    sends: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Reading:
    """A field that the document and the standard read differently, decided for each node from its data.

    The first of `evidence` that holds decides; `otherwise` is the choice when none does (empty: undecided). The notes
    on the field hold for nodes of the choice `noted`, for all if it is empty.
    """

    name: str
    field: str
    choices: tuple[str, ...]
    evidence: tuple[Evidence, ...]
    otherwise: str = ""
    clause: str = ""
    noted: str = ""


@dataclass(frozen=True, slots=True)
class Message:
    """A data type, or one half of a service: its identity on the bus, its layout and what its values mean.

    `turns` is the column that is not 0 while the motor of its sender, an ESC, turns; empty if it tells of none.
    `actuates` says that whoever receives it may move, release or enable something, or change what it has stored: not
    to be sent by accident. `role` is what its sender is, in a word for people.
    """

    name: str
    full_name: str
    kind: MessageKind
    type_id: int
    signature: int
    layout: CompoundType
    notes: Mapping[str, Note] = field(default_factory=dict)
    derived: tuple[Derived, ...] = ()
    packets: PacketFamily | None = None
    prefix: bool = False
    readings: tuple[Reading, ...] = ()
    clause: str = ""
    summary: str = ""
    aliases: tuple[str, ...] = ()
    turns: str = ""
    actuates: bool = False
    role: str = ""
    remarks: tuple[Remark, ...] = ()

    @property
    def table(self) -> str:
        """Name of the message's table: the name, with `.Request` or `.Response` for a service."""
        return self.name if self.kind == "message" else f"{self.name}.{self.kind.capitalize()}"

    @property
    def min_bytes(self) -> int:
        """Shortest payload on classic CAN."""
        return _bytes(wire_bits(self.layout, tail=True)[0])

    @property
    def max_bytes(self) -> int:
        """Longest payload on classic CAN, where a tail array has no length field."""
        return _bytes(wire_bits(self.layout, tail=True)[1])

    @property
    def min_bytes_with_length(self) -> int:
        """Shortest payload on CAN FD."""
        return _bytes(wire_bits(self.layout, tail=False)[0])

    @property
    def max_bytes_with_length(self) -> int:
        """Longest payload on CAN FD, before padding: every dynamic array has its length field."""
        return _bytes(wire_bits(self.layout, tail=False)[1])

    def plan(self) -> list[PlanToken]:
        """Return the layout as the native core runs it: tokens in preorder."""
        return plan(self.layout)


@dataclass(frozen=True, slots=True)
class Dissector:
    """Everything that one folder says."""

    name: str
    version: str
    messages: tuple[Message, ...]


def _bytes(bits: int) -> int:
    return (bits + 7) // 8
