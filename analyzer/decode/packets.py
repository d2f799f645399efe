"""Packets inside the byte array of a message: found natively, one table a packet type."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from analyzer import _native
from analyzer.decode.columns import senders
from dissectors.kit.cells import numbers

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from dissectors.kit import Array
    from dissectors.schema import Message, Packet, PacketFamily


NO_FAMILY = 255
_STEPS = ("count_step", "count_step_id")
REASONS = ("no header", "unknown frame id", "truncated")


@dataclass(frozen=True)
class FoundPackets:
    """The packets of one table in one batch.

    `rows` are rows of the carrying message's table `source`, `bounds` (i32) cut the packets out of `data` (u8), and
    `offset` is where each begins in the array that carries it; `columns` say where each lies and whether it is sound.
    Without `packet` and `family` the bytes are none that the profile knows.
    """

    table: str
    packet: Packet | None
    family: PacketFamily | None
    source: pa.RecordBatch
    rows: Array
    offset: Array
    columns: list[tuple[pa.Field, pa.Array]]
    bounds: Array
    data: Array

    @cached_property
    def senders(self) -> Array:
        """The sending node of each packet, u16: bus and source node ID."""
        sent: Array = senders(self.source)[self.rows]
        return sent

    @cached_property
    def sound(self) -> Array:
        """Packets that can be relied on: whole, with the right length and checksum, in a transfer with a good CRC."""
        ok = next(array for field, array in self.columns if field.name == "packet_ok")
        good: Array = numbers(ok) & numbers(self.source.column("trusted"))[self.rows]
        return good

    @cached_property
    def positions(self) -> Array:
        """Places in the order of sending, u64, through the whole capture: transfer row, then byte in the array."""
        return numbers(self.source.column("transfer"))[self.rows] << np.uint64(16) | self.offset


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

    def find(self, message: Message, table: pa.RecordBatch) -> Iterator[FoundPackets]:
        """Return the packets in the rows of `table`, and the bytes that are none."""
        own = next((k for k, (m, _) in enumerate(self._carriers) if m.table == message.table), None)
        if own is None:
            return
        lists = table.column(self._carriers[own][1].field)
        _, offsets, _, values = lists.buffers()
        data = b"" if values is None else values.to_pybytes()
        senders = table.column("bus").to_numpy().tobytes(), table.column("src").to_numpy().tobytes()
        columns = self._native.find(own, message.type_id, offsets.to_pybytes(), data, senders)
        got = {name: np.frombuffer(columns[name], kind) for name, kind in _KINDS.items()}
        raw = np.frombuffer(data, np.uint8)
        known = (got["spec"] >= 0) & (got["family"] != NO_FAMILY)
        codes = got["family"].astype(np.uint32) << 16 | got["spec"].astype(np.uint16)
        for code in np.unique(codes[known]).tolist():
            family = self._carriers[code >> 16][1]
            packet = family.packets[code & 0xFFFF]
            here = np.flatnonzero(known & (codes == code))
            yield _found(f"{message.table}.{packet.name}", (family, packet), table, here, got, raw)
        rest = np.flatnonzero(~known)
        if rest.size:
            yield _found(f"{message.table}.unrecognized", (None, None), table, rest, got, raw)


def _found(
    name: str, what: tuple[PacketFamily, Packet] | tuple[None, None], source: pa.RecordBatch, here: Array,
    got: dict[str, Array], raw: Array,
) -> FoundPackets:  # fmt: skip
    starts, lengths, offset = got["start"][here], got["len"][here], got["offset"][here]
    bounds = np.zeros(len(here) + 1, np.int32)
    np.cumsum(lengths, out=bounds[1:])
    if (starts[1:] == starts[:-1] + lengths[:-1]).all():
        data = raw[starts[0] : starts[0] + bounds[-1]]
    else:
        data = raw[np.repeat(starts - bounds[:-1], lengths) + np.arange(bounds[-1])]
    columns = [(pa.field("offset", pa.uint32(), metadata={"unit": "byte"}), pa.array(offset))]
    family, packet = what
    if packet is None:
        cut = pa.Array.from_buffers(pa.binary(), len(here), [None, pa.py_buffer(bounds), pa.py_buffer(data.tobytes())])
        reason = pa.array([REASONS[code] for code in got["reason"][here].tolist()], pa.string())
        columns += [(pa.field("reason", pa.string()), reason), (pa.field("data", pa.binary()), cut)]
    else:
        columns += _verdicts(here, got)
    return FoundPackets(name, packet, family, source, got["row"][here], offset, columns, bounds, data)


def _verdicts(here: Array, got: dict[str, Array]) -> list[tuple[pa.Field, pa.Array]]:
    flags = {name: got[name][here] != 0 for name in ("header_ok", "length_ok", "complete", "checksum_ok")}
    ok = flags["length_ok"] & flags["complete"] & flags["checksum_ok"]
    end = got["checksum_end"][here]
    columns = [
        ("packet_ok", pa.array(ok)),
        *((name, pa.array(flag)) for name, flag in flags.items()),
        ("checksum_end", pa.array(end, mask=end == 0)),
        *((name, pa.array(got[name][here], mask=got[f"{name}_valid"][here] == 0)) for name in _STEPS),
    ]
    return [(pa.field(name, array.type), array) for name, array in columns]


_KINDS = {
    "row": np.uint32,
    "offset": np.uint32,
    "start": np.int32,
    "len": np.int32,
    "family": np.uint8,
    "spec": np.int16,
    "header_ok": np.uint8,
    "length_ok": np.uint8,
    "complete": np.uint8,
    "checksum_ok": np.uint8,
    "checksum_end": np.uint8,
    "reason": np.uint8,
    "count_step": np.uint8,
    "count_step_valid": np.uint8,
    "count_step_id": np.uint8,
    "count_step_id_valid": np.uint8,
}
