"""Transfers to typed messages: one table a data type, and by the same call one a packet inside a message."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from analyzer.decode.byteorder import ByteOrder
from analyzer.decode.columns import Assembler, Description, metadata
from analyzer.decode.packets import CARRIED, PacketFinder, PacketTables, unrecognized
from analyzer.decode.readings import Readings
from analyzer.decode.sent import SentMessages
from analyzer.decode.tables import LazyTables
from analyzer.decode.told import ToldColumns
from analyzer.tables import TRANSFERS

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Mapping, Sequence

    from analyzer._native import Group
    from analyzer.decode.packets import FoundPackets
    from analyzer.decode.readings import Statement
    from analyzer.decode.told import Told
    from dissectors.kit import Array
    from dissectors.registry import Registry
    from dissectors.schema import Message

# What stands in front of the fields of a message.
_CONTEXT = (*CARRIED[:-1], TRANSFERS.field("dst"), CARRIED[-1])
_MEASURED = (
    pa.field("bits_left", pa.int32(), metadata={"unit": "bit"}),
    pa.field("pad_nonzero", pa.bool_()),
    pa.field("bad_tag", pa.bool_()),
    pa.field("layout", pa.uint8()),
)


class MessageTables:
    """The tables of one message: described once, made by the native core of any group of its transfers."""

    def __init__(self, message: Message) -> None:
        described = Description(message.layout, message.notes, message.derived)
        if message.prefix:
            packets = message.packets
            described.expect_length(None if packets is None else (message.min_bytes, packets.header))
        context = [one for one in _CONTEXT if one.name != "dst" or message.kind != "message"]
        about = metadata(type=message.full_name, clause=message.clause)
        self._native = described.native
        self._assembler = Assembler([*context, *_MEASURED, *described.fields], about)
        if message.packets is not None:
            names = [one.name for one in described.fields]
            self._carries = len(context) + len(_MEASURED) + names.index(message.packets.field)

    def make(self, group: Group, first: int) -> pa.RecordBatch:
        """Return the table of a group; the batch begins with transfer `first` of the capture."""
        return self._assembler.table(self._native.table(group, first))

    def make_carriers(self, group: Group, first: int) -> tuple[pa.RecordBatch, tuple[pa.Buffer, pa.Buffer]]:
        """Return it with the byte arrays that may carry packets: i32 offsets and bytes."""
        table = self.make(group, first)
        _, offsets, _, data = table.column(self._carries).buffers()
        return table, (offsets, data)


@dataclass(frozen=True, slots=True)
class ReadMessages:
    """The messages of a batch; doubtful fields, and the byte order of packets, may still be decided."""

    sent: dict[str, SentMessages]
    whole: dict[str, pa.RecordBatch]  # tables that had to be made
    packets: list[FoundPackets]


class Messages:
    """From the transfers of a batch to message and packet tables; remembers plans, and what went before a packet."""

    def __init__(
        self, registry: Registry, forced: Mapping[int, Collection[str]] | None = None, *, ahead: bool = False,
        only: Collection[str] | None = None,
    ) -> None:  # fmt: skip
        self.registry, self._only = registry, only
        doubtful = (one for one in registry.doubtful() if only is None or one.table in only)
        self._readings = Readings(doubtful, forced or {}, ahead=ahead)
        self._tables: dict[str, MessageTables] = {}
        self._packet_tables: dict[str, PacketTables] = {}
        self._told_columns: dict[str, ToldColumns] = {}
        carriers = registry.carriers()
        wanted = None if only is None else {name.rpartition(".")[0] for name in only}
        self._carriers = {one.table for one in carriers if wanted is None or one.table in wanted}
        self._finder = PacketFinder(carriers)
        packets = (packet for family in registry.families() for packet in family.packets if self._carriers)
        self._order = ByteOrder(packets, forced or {}, ahead=ahead)

    def read(self, groups: Iterable[Group], first: int, *, last: bool) -> ReadMessages:
        """Learn from the transfers of known types how nodes are to be read.

        `first` is the number of the batch's first transfer; `last` is true at the end of the capture.
        """
        sent: dict[str, SentMessages] = {}
        carriers: dict[str, tuple[Message, Group]] = {}
        for group in groups:
            message = self.registry.message(group.kind, group.type_id, group.variant)
            if message is not None:
                sent[message.table] = SentMessages(group, first, partial(self._decode, message))
                if message.table in self._carriers:
                    carriers[message.table] = message, group
        self._readings.learn(sent, last=last)
        # Packets come last: how their bytes are read depends on the messages around them.
        whole: dict[str, pa.RecordBatch] = {}
        found: list[FoundPackets] = []
        for name, (message, group) in carriers.items():
            whole[name], arrays = self._of(message).make_carriers(group, first)
            found += self._finder.find(message, group, first, arrays)
        if self._carriers:
            self._order.learn(sent, found, self._read)
        return ReadMessages(sent, whole, found)

    def told(self, read: ReadMessages) -> LazyTables:
        """Return the tables as their nodes are read by now; to be called in the order of reading."""
        makers = {
            name: partial(self._told, read, name, self._readings.now(name)) for name in read.sent if self._asked(name)
        }
        return LazyTables(makers | {one.table: self._packets(one) for one in read.packets if self._asked(one.table)})

    def _asked(self, table: str) -> bool:
        return self._only is None or table in self._only

    @property
    def waiting(self) -> bool:
        """True if a node is not decided that may still be."""
        return self._readings.waiting or self._order.waiting

    def know(self, other: Messages) -> None:
        """Take over what another one has decided of nodes."""
        self._readings.know(other._readings)
        self._order.know(other._order)

    def statements(self) -> tuple[Statement, ...]:
        """Return what is known of the doubtful fields of nodes."""
        return *self._readings.statements(), *self._order.statements()

    def _told(self, read: ReadMessages, name: str, readings: Sequence[Told]) -> pa.RecordBatch:
        whole = read.whole.get(name)
        rows = read.sent[name].whole() if whole is None else whole
        if not readings:
            return rows
        columns = self._told_columns.get(name)
        if columns is None:
            columns = self._told_columns[name] = ToldColumns(readings, rows.schema)
        return columns.tell(readings, rows)

    def _decode(self, message: Message, group: Group, first: int) -> pa.RecordBatch:
        return self._of(message).make(group, first)

    def _of(self, message: Message) -> MessageTables:
        tables = self._tables.get(message.table)
        if tables is None:
            tables = self._tables[message.table] = MessageTables(message)
        return tables

    def _packets(self, found: FoundPackets) -> Callable[[], pa.RecordBatch]:
        """Return what makes the table of packets as they are read by now."""
        if found.packet is None:
            return partial(unrecognized, found.rows)
        order = (self._order.big_endian(found), self._order.decided(found)) if found.packet.numbers else None
        tables = self._of_packet(found)
        if tables.wraps:
            made = tables.make(found.rows, order)  # how far a counter has come depends on all packets before
            return lambda: made
        return partial(tables.make, found.rows, order)

    def _of_packet(self, found: FoundPackets) -> PacketTables:
        assert found.packet is not None  # noqa: S101 - bytes that are no packet have no fields
        assert found.family is not None  # noqa: S101
        tables = self._packet_tables.get(found.table)
        if tables is None:
            tables = self._packet_tables[found.table] = PacketTables(found.packet, found.family)
        return tables

    def _read(self, found: FoundPackets, places: Array) -> tuple[Mapping[str, pa.Array], ...]:
        rows = found.rows.pick(places.astype(np.uint32).tobytes())
        return tuple(self._of_packet(found).read(rows, big=big) for big in (False, True))
