"""Transfers to typed messages: one table a data type, and by the same call one a packet inside a message."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from analyzer import _native
from analyzer.decode.byteorder import ByteOrder, swapped
from analyzer.decode.columns import assemble, enrich, members, metadata, scaled
from analyzer.decode.packets import PacketFinder
from analyzer.decode.prefix import PREFIX, TAIL, with_length
from analyzer.decode.readings import Readings
from analyzer.decode.sent import SentMessages, cells
from analyzer.decode.tables import LazyTables
from analyzer.decode.told import tell
from analyzer.decode.unwrap import Unwrapper
from analyzer.tables import TRANSFERS, column
from dissectors.kit.cells import numbers
from dissectors.schema import plan

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence

    from analyzer._native import Group
    from analyzer.decode.packets import FoundPackets
    from analyzer.decode.readings import Statement
    from analyzer.decode.told import Told
    from dissectors.kit import Array
    from dissectors.registry import Registry
    from dissectors.schema import CompoundType, Derived, Message, Note, Packet

# What stands in front of the fields of a message, and of that what is repeated for every packet in it.
_CONTEXT = (
    pa.field("transfer", pa.uint64()),
    *(TRANSFERS.field(name) for name in ("t", "bus", "src", "dst")),
    pa.field("trusted", pa.bool_()),
)
_CARRIED = ("transfer", "t", "bus", "src", "trusted")
BAD_TAG = 2  # flag of the native core: a union's tag names no member


@dataclass(frozen=True, slots=True)
class Unpacked:
    """Rows of one layout: a column a field, and per row the bits left over and the flags."""

    arrays: list[pa.Array]
    left: Array
    flags: Array


@dataclass(slots=True)
class Unpacker:
    """A layout with its meaning, ready to run over rows: the plan is compiled once."""

    layout: CompoundType
    notes: Mapping[str, Note]
    derived: tuple[Derived, ...]
    _plan: _native.Plan = field(init=False)

    def __post_init__(self) -> None:
        """Compile the plan."""
        self._plan = _native.Plan(plan(self.layout))

    def run(self, rows: Group | tuple[bytes, bytes], codes: Array) -> Unpacked:
        """Unpack the rows of a group, or bytes cut by i32 offsets; a layout code a row."""
        layouts = codes.astype(np.uint8).tobytes()
        if isinstance(rows, tuple):
            flat, left, flags = self._plan.unpack(*rows, layouts)
        else:
            flat, left, flags = rows.unpack(self._plan, layouts)
        whole = assemble(self.layout, iter(flat))
        arrays = [whole.field(k) for k in range(whole.type.num_fields)]
        return Unpacked(arrays, cells(left, np.int32), cells(flags, np.uint8))

    def columns(self, arrays: list[pa.Array]) -> list[tuple[pa.Field, pa.Array]]:
        """Return named columns with units, parts and derived values."""
        return enrich(self.layout, arrays, self.notes, self.derived)

    def plausible(self, arrays: list[pa.Array]) -> Array:
        """Return rows in which every limited number is inside its limits."""
        good = np.ones(len(arrays[0]) if arrays else 0, bool)
        names = [pair[0].name for pair in enrich(self.layout, arrays, {}, ())]
        for name, array in zip(names, arrays, strict=True):
            note = self.notes.get(name)
            if note is None or (note.low is None and note.high is None):
                continue
            low = -np.inf if note.low is None else float(note.low)
            high = np.inf if note.high is None else float(note.high)
            for row, value in enumerate(array.to_pylist()):
                cells = value if isinstance(value, list) else [value]
                good[row] &= all(c is None or low <= c <= high or c in note.special for c in cells)
        return good


@dataclass(frozen=True, slots=True)
class ReadMessages:
    """The messages of a batch; doubtful fields, and the byte order of packets, may still be decided."""

    sent: dict[str, SentMessages]
    whole: dict[str, pa.RecordBatch]  # tables that had to be made
    packets: list[FoundPackets]


class Messages:
    """From the transfers of a batch to message and packet tables; remembers plans, and what went before a packet."""

    def __init__(
        self, registry: Registry, forced: Mapping[int, Collection[str]] | None = None, *, ahead: bool = False
    ) -> None:
        self.registry = registry
        self._readings = Readings(registry.doubtful(), forced or {}, ahead=ahead)
        self._unpackers: dict[str, Unpacker] = {}
        self._unwrappers: dict[tuple[str, str], Unwrapper] = {}
        carriers = registry.carriers()
        self._carriers = {message.table: message for message in carriers}
        self._finder = PacketFinder(carriers)
        packets = (packet for family in registry.families() for packet in family.packets)
        self._order = ByteOrder(packets, forced or {}, ahead=ahead)

    def read(self, groups: Iterable[Group], first: int, *, last: bool) -> ReadMessages:
        """Learn from the transfers of known types how nodes are to be read.

        `first` is the number of the batch's first transfer; `last` is true at the end of the capture.
        """
        sent: dict[str, SentMessages] = {}
        for group in groups:
            message = self.registry.message(group.kind, group.type_id, group.variant)
            if message is not None:
                sent[message.table] = SentMessages(group, first, partial(self._decode, message))
        self._readings.learn(sent, last=last)
        # Packets come last: how their bytes are read depends on the messages around them.
        whole = {name: sent[name].whole() for name in sent if name in self._carriers}
        found = [one for name, table in whole.items() for one in self._finder.find(self._carriers[name], table)]
        self._order.learn(sent, found, self._unpack)
        return ReadMessages(sent, whole, found)

    def told(self, read: ReadMessages) -> LazyTables:
        """Return the tables as their nodes are read by now; to be called in the order of reading."""
        makers = {name: partial(self._told, read, name, self._readings.now(name)) for name in read.sent}
        return LazyTables(makers | {one.table: self._packets(one) for one in read.packets})

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
        return tell(readings, read.sent[name].whole() if whole is None else whole)

    def _decode(self, message: Message, group: Group, first: int) -> pa.RecordBatch:
        unpacker = self._unpacker(message.table, message)
        codes, found = self._read(message, unpacker, group)
        columns = group.context(first)
        context = [(field, column(field, columns, len(group))) for field in _CONTEXT if field.name in columns]
        measured = [
            (pa.field("bits_left", pa.int32(), metadata={"unit": "bit"}), pa.array(found.left)),
            (pa.field("pad_nonzero", pa.bool_()), pa.array(found.flags & 1 != 0)),
            (pa.field("bad_tag", pa.bool_()), pa.array(found.flags & BAD_TAG != 0)),
            (pa.field("layout", pa.uint8()), pa.array(codes)),
        ]
        about = metadata(type=message.full_name, clause=message.clause)
        return _batch([*context, *measured, *unpacker.columns(found.arrays)], about)

    def _read(self, message: Message, unpacker: Unpacker, group: Group) -> tuple[Array, Unpacked]:
        """Return the layout codes of rows, and what they unpack to.

        CAN FD always carries array lengths, classic CAN leaves out that of the tail array, with exceptions.
        """
        fd = cells(group.fd(), bool)
        codes = np.where(fd, np.uint8(PREFIX), np.uint8(TAIL))
        found = unpacker.run(group, codes)
        if not message.prefix:
            return codes, found
        classic = np.flatnonzero(~fd)
        mine = group.pick(classic.astype(np.uint32).tobytes())

        def attempt(some: Array, code: int) -> tuple[Array, Array, Array]:
            tried = unpacker.run(mine.pick(some.astype(np.uint32).tobytes()), np.full(len(some), code))
            return tried.left, tried.flags, unpacker.plausible(tried.arrays)

        codes[classic] = with_length(message, mine, found.left[classic], attempt)
        return codes, unpacker.run(group, codes) if codes[classic].any() else found

    def _packets(self, found: FoundPackets) -> Callable[[], pa.RecordBatch]:
        """Return what makes the table of packets as they are read by now."""
        if found.packet is None or not found.packet.numbers:
            return partial(self._packet_table, found, None, None)
        big, decided = self._order.big_endian(found), self._order.decided(found)
        make = partial(self._packet_table, found, big, decided)
        if any(note.wraps for note in found.packet.notes.values()):
            made = make()  # how far a counter has come depends on all packets before
            return lambda: made
        return make

    def _packet_table(self, found: FoundPackets, big: Array | None, decided: Array | None) -> pa.RecordBatch:
        rows = pa.array(found.rows)
        schema = found.source.schema
        columns = [(schema.field(name), found.source.column(name).take(rows)) for name in _CARRIED]
        columns += found.columns
        if found.packet is None:
            return _batch(columns, {})
        data = found.data
        if big is not None:
            columns.append((pa.field("big_endian", pa.bool_()), pa.array(big)))
            columns.append((pa.field("decided", pa.bool_()), pa.array(decided)))
            if big.any():
                starts, ends = found.bounds[:-1][big], found.bounds[1:][big]
                data = swapped(data, starts, ends, found.packet.numbers)
        arrays = self._unpack(found, found.bounds, data)
        columns += self._unpacker(found.table, found.packet).columns(arrays)
        columns += self._unwrapped(found, big, arrays)
        return _batch(columns, metadata(clause=found.packet.clause))

    def _unpack(self, found: FoundPackets, bounds: Array, data: Array) -> list[pa.Array]:
        """Return the fields of packets like those found, little-endian."""
        assert found.packet is not None  # noqa: S101 - bytes that are no packet have no fields
        unpacker = self._unpacker(found.table, found.packet)
        return unpacker.run((bounds.tobytes(), data.tobytes()), np.full(len(bounds) - 1, TAIL)).arrays

    def _unwrapped(
        self, found: FoundPackets, big: Array | None, arrays: list[pa.Array]
    ) -> Iterator[tuple[pa.Field, pa.Array]]:
        """Return `<field>.unwrapped` of wrapping counters, per node, unit and byte order; null for a damaged packet."""
        if found.packet is None or found.family is None:
            return
        for member, array in zip(members(found.packet.layout), arrays, strict=True):
            note = found.packet.notes.get(member.name)
            if note is None or not note.wraps:
                continue
            key = (found.table, member.name)
            if key not in self._unwrappers:
                self._unwrappers[key] = Unwrapper(member.type.bits)
            good = np.flatnonzero(found.sound)
            units = found.data[found.bounds[good] + found.family.unit_at]
            # A wrong byte order is no part of the sequence: node IDs leave bit 7 free.
            turned = np.zeros(len(good), bool) if big is None else big[good]
            counters = (found.senders[good].astype(np.uint32) | turned << np.uint32(7)) << np.uint32(8) | units
            values = np.zeros(len(array), np.uint64)
            values[good] = self._unwrappers[key].follow(counters, numbers(array)[good])
            total = pa.array(values, mask=~found.sound)
            total = total if note.scale is None else scaled(total, note.scale)
            about = metadata(unit=note.unit, clause=note.clause, source=member.name)
            yield pa.field(f"{member.name}.unwrapped", total.type, metadata=about), total

    def _unpacker(self, table: str, of: Message | Packet) -> Unpacker:
        if table not in self._unpackers:
            self._unpackers[table] = Unpacker(of.layout, of.notes, of.derived)
        return self._unpackers[table]


def _batch(columns: list[tuple[pa.Field, pa.Array]], about: dict[str, str]) -> pa.RecordBatch:
    """Rename a field that is called like a column in front of it: `src` becomes `src.field`."""
    fields: dict[str, pa.Field] = {}
    for one, _ in columns:
        own = one if one.name not in fields else one.with_name(f"{one.name}.field")
        fields[own.name] = own
    schema = pa.schema(fields.values(), metadata=about)
    return pa.RecordBatch.from_arrays([array for _, array in columns], schema=schema)
