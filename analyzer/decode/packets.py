"""Packets inside the byte array of a message: found natively, one table a packet type."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from analyzer import _native
from analyzer.decode.columns import Assembler, Description, metadata
from analyzer.decode.sent import cells
from analyzer.tables import TRANSFERS

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analyzer._native import Group, PacketRows
    from dissectors.kit import Array
    from dissectors.schema import Message, Packet, PacketFamily


UNRECOGNIZED = "unrecognized"  # the table of bytes that no profile knows, behind the name of their message
# What is repeated for every packet of what stands in front of the fields of its message.
CARRIED = (
    pa.field("transfer", pa.uint64()),
    *(TRANSFERS.field(name) for name in ("t", "bus", "src")),
    pa.field("trusted", pa.bool_()),
)
_OFFSET = pa.field("offset", pa.uint32(), metadata={"unit": "byte"})
_VERDICTS = (
    *(pa.field(name, pa.bool_()) for name in ("packet_ok", "header_ok", "length_ok", "complete", "checksum_ok")),
    *(pa.field(name, pa.uint8()) for name in ("checksum_end", "count_step", "count_step_id")),
)
_ORDER = (pa.field("big_endian", pa.bool_()), pa.field("decided", pa.bool_()))
_UNRECOGNIZED = (pa.field("reason", pa.string()), pa.field("data", pa.binary()))


@dataclass(frozen=True)
class FoundPackets:
    """The packets of one table in one batch. Without `packet` and `family` they are bytes that no profile knows."""

    table: str
    packet: Packet | None
    family: PacketFamily | None
    rows: PacketRows

    @cached_property
    def senders(self) -> Array:
        """The sending node of each packet, u16: bus and source node ID."""
        return cells(self.rows.senders(), np.uint16)

    @cached_property
    def sound(self) -> Array:
        """Packets that can be relied on: whole, with the right length and checksum, in a transfer with a good CRC."""
        return cells(self.rows.sound(), bool)

    @cached_property
    def positions(self) -> Array:
        """Places in the order of sending, u64, through the whole capture: transfer row, then byte in the array."""
        return cells(self.rows.positions(), np.uint64)


class PacketTables:
    """The tables of one packet: described once, made by the native core; knows how far its counters have come."""

    def __init__(self, packet: Packet, family: PacketFamily) -> None:
        described = Description(packet.layout, packet.notes, packet.derived)
        described.native.numbers(list(packet.numbers))
        continued = list(described.unwrapped(family.unit_at))
        order = _ORDER if packet.numbers else ()
        own = [*CARRIED, _OFFSET, *_VERDICTS, *order, *described.fields, *continued]
        self._native = described.native
        self._whole = Assembler(own, metadata(clause=packet.clause))
        self._fields = Assembler(described.fields, {})
        self.wraps = bool(continued)
        self._counters = _native.Counters() if self.wraps else None

    def make(self, rows: PacketRows, order: tuple[Array, Array] | None) -> pa.RecordBatch:
        """Return their table; `order` says which are big-endian, and of which that is decided.

        To be called in the order of the capture if there are counters that wrap; else by any threads at once.
        """
        flags = None if order is None else (order[0].tobytes(), order[1].tobytes())
        return self._whole.table(self._native.packets(rows, flags, self._counters or _native.Counters()))

    def read(self, rows: PacketRows, *, big: bool) -> dict[str, pa.Array]:
        """Return the columns of the fields of whole packets, all read in one byte order, by name."""
        table = self._fields.table(self._native.packet_fields(rows, big))
        return dict(zip(table.schema.names, table.columns, strict=True))


_UNKNOWN = Assembler([*CARRIED, _OFFSET, *_UNRECOGNIZED], {})


def unrecognized(rows: PacketRows) -> pa.RecordBatch:
    """Return the table of bytes that are no packet."""
    return _UNKNOWN.table(_native.unrecognized(rows))


class PacketFinder:
    """The packets of all messages of one dissector that carry any; headers of one may turn up in another."""

    def __init__(self, carriers: Sequence[Message]) -> None:
        self._carriers = [(m, m.packets) for m in carriers if m.packets is not None]
        self._native = _native.Packets(
            [
                (
                    f.header, f.id_at, f.count_at, f.unit_at, f.length_at,
                    [(p.id, p.length, list(p.checksum_ends)) for p in f.packets],
                )
                for _, f in self._carriers
            ]
        )  # fmt: skip

    def find(
        self, message: Message, group: Group, first: int, arrays: tuple[pa.Buffer, pa.Buffer]
    ) -> Iterator[FoundPackets]:
        """Return the packets in the byte arrays (i32 offsets, bytes) of some messages, and the bytes that are none."""
        own = next(k for k, (m, _) in enumerate(self._carriers) if m.table == message.table)
        for rows in self._native.find(own, group, first, *arrays):
            if rows.known is None:
                yield FoundPackets(f"{message.table}.{UNRECOGNIZED}", None, None, rows)
                continue
            family = self._carriers[rows.known[0]][1]
            packet = family.packets[rows.known[1]]
            yield FoundPackets(f"{message.table}.{packet.name}", packet, family, rows)
