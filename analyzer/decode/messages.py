"""Transfers to typed messages: one table a data type, and by the same call one a packet inside a message."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from analyzer import _native
from analyzer.decode.byteorder import ByteOrder, swapped
from analyzer.decode.columns import assemble, enrich, members, metadata, scaled
from analyzer.decode.packets import PacketFinder
from analyzer.decode.prefix import PREFIX, TAIL, with_length
from analyzer.decode.readings import Readings
from analyzer.decode.unwrap import Unwrapper
from analyzer.tables import STATUSES
from dissectors.kit.cells import numbers
from dissectors.schema import plan

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping

    from analyzer.decode.packets import FoundPackets
    from analyzer.decode.readings import Statement
    from dissectors.kit import Array
    from dissectors.registry import Registry
    from dissectors.schema import CompoundType, Derived, Message, Note, Packet


_CONTEXT = ("transfer", "t", "bus", "src", "trusted")  # of a message table, repeated for every packet in it
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

    def run(self, offsets: bytes, payload: bytes, codes: Array, rows: Array | None = None) -> Unpacked:
        """Unpack the u32 `rows` (all without) of `payload`, cut by i32 `offsets`; a layout code a row."""
        picked = None if rows is None else rows.astype(np.uint32).tobytes()
        flat, left, flags = self._plan.unpack(offsets, payload, codes.astype(np.uint8).tobytes(), picked)
        whole = assemble(self.layout, iter(flat))
        arrays = [whole.field(k) for k in range(whole.type.num_fields)]
        return Unpacked(arrays, np.frombuffer(left, np.int32), np.frombuffer(flags, np.uint8))

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
    """Tables whose doubtful fields, and packets whose byte order, may still be decided."""

    tables: dict[str, pa.RecordBatch]
    packets: list[FoundPackets]


class Messages:
    """From the rows of a batch to message and packet tables; remembers plans, and what went before a packet."""

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

    def decode(
        self, transfers: pa.RecordBatch, payload: tuple[bytes, bytes], groups: Iterable[tuple[bool, int, int, bytes]],
        first_row: int, *, last: bool = False,
    ) -> dict[str, pa.RecordBatch]:  # fmt: skip
        """Return the tables of every known type in `transfers`; what `read` takes."""
        return self.told(self.read(transfers, payload, groups, first_row, last=last))

    def read(
        self, transfers: pa.RecordBatch, payload: tuple[bytes, bytes], groups: Iterable[tuple[bool, int, int, bytes]],
        first_row: int, *, last: bool,
    ) -> ReadMessages:  # fmt: skip
        """Unpack every known type in `transfers`, and learn from that how nodes are to be read.

        `payload` is that of all rows, as i32 offsets and bytes; `groups` are the rows by (service, type ID, variant);
        `last` is true at the end of the capture.
        """
        out: dict[str, pa.RecordBatch] = {}
        kinds = numbers(transfers.column("kind"))
        for service, type_id, variant, picked in groups:
            rows = np.frombuffer(picked, np.uint32)
            for kind in (2, 3) if service else (0,):
                # An anonymous message is a message of the same type.
                here = rows[kinds[rows] == kind] if service else rows
                message = self.registry.message(kind, type_id, variant)
                if message is not None and here.size:
                    out[message.table] = self._decode(message, transfers, payload, here, first_row)
        self._readings.learn(out, last=last)
        # Packets come last: how their bytes are read depends on the messages around them.
        carrying = [(self._carriers[name], table) for name, table in out.items() if name in self._carriers]
        found = [one for message, table in carrying for one in self._finder.find(message, table)]
        self._order.learn(out, found, self._unpack)
        return ReadMessages(out, found)

    def told(self, read: ReadMessages) -> dict[str, pa.RecordBatch]:
        """Return the tables as their nodes are read by now; to be asked for in the order of reading."""
        out = {name: self._readings.told(name, table) for name, table in read.tables.items()}
        return out | {one.table: self._packets(one) for one in read.packets}

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

    def _decode(
        self, message: Message, transfers: pa.RecordBatch, payload: tuple[bytes, bytes], rows: Array, first_row: int
    ) -> pa.RecordBatch:
        unpacker = self._unpacker(message.table, message)
        codes, found = self._read(message, unpacker, transfers, payload, rows)
        wanted = pa.array(rows)

        def picked(name: str) -> pa.Array:
            return transfers.column(name).take(wanted)

        context: list[tuple[pa.Field, pa.Array]] = [
            (pa.field("transfer", pa.uint64()), pa.array(rows.astype(np.uint64) + np.uint64(first_row))),
            *((transfers.schema.field(c), picked(c)) for c in ("t", "bus", "src")),
        ]
        if message.kind != "message":
            context.append((transfers.schema.field("dst"), picked("dst")))
        trusted = numbers(transfers.column("status"))[rows] == STATUSES.index("ok")
        context.append((pa.field("trusted", pa.bool_()), pa.array(trusted)))
        measured = [
            (pa.field("bits_left", pa.int32(), metadata={"unit": "bit"}), pa.array(found.left)),
            (pa.field("pad_nonzero", pa.bool_()), pa.array(found.flags & 1 != 0)),
            (pa.field("bad_tag", pa.bool_()), pa.array(found.flags & BAD_TAG != 0)),
            (pa.field("layout", pa.uint8()), pa.array(codes)),
        ]
        about = metadata(type=message.full_name, clause=message.clause)
        return _batch([*context, *measured, *unpacker.columns(found.arrays)], about)

    def _read(
        self, message: Message, unpacker: Unpacker, transfers: pa.RecordBatch, payload: tuple[bytes, bytes], rows: Array
    ) -> tuple[Array, Unpacked]:
        """Return the layout codes of rows, and what they unpack to.

        CAN FD always carries array lengths, classic CAN leaves out that of the tail array, with exceptions.
        """
        fd = numbers(transfers.column("fd"))[rows]
        codes = np.where(fd, np.uint8(PREFIX), np.uint8(TAIL))
        found = unpacker.run(*payload, codes, rows)
        if not message.prefix:
            return codes, found
        bounds = np.frombuffer(payload[0], np.int32)
        classic = np.flatnonzero(~fd)
        mine = rows[classic]

        def attempt(some: Array, code: int) -> tuple[Array, Array, Array]:
            tried = unpacker.run(*payload, np.full(len(some), code), mine[some])
            return tried.left, tried.flags, unpacker.plausible(tried.arrays)

        starts, lengths = bounds[mine], bounds[mine + 1] - bounds[mine]
        data = np.frombuffer(payload[1], np.uint8)
        codes[classic] = with_length(message, starts, lengths, found.left[classic], data, attempt)
        return codes, unpacker.run(*payload, codes, rows) if codes[classic].any() else found

    def _packets(self, found: FoundPackets) -> pa.RecordBatch:
        rows = pa.array(found.rows)
        schema = found.source.schema
        columns = [(schema.field(name), found.source.column(name).take(rows)) for name in _CONTEXT]
        columns += found.columns
        if found.packet is None:
            return _batch(columns, {})
        data = found.data
        big = self._order.big_endian(found)
        if found.packet.numbers:
            columns.append((pa.field("big_endian", pa.bool_()), pa.array(big)))
            columns.append((pa.field("decided", pa.bool_()), pa.array(self._order.decided(found))))
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
        return unpacker.run(bounds.tobytes(), data.tobytes(), np.full(len(bounds) - 1, TAIL)).arrays

    def _unwrapped(
        self, found: FoundPackets, big: Array, arrays: list[pa.Array]
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
            counters = (found.senders[good].astype(np.uint32) | big[good] << np.uint32(7)) << np.uint32(8) | units
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
    for column, _ in columns:
        own = column if column.name not in fields else column.with_name(f"{column.name}.field")
        fields[own.name] = own
    schema = pa.schema(fields.values(), metadata=about)
    return pa.RecordBatch.from_arrays([array for _, array in columns], schema=schema)
