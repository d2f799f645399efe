"""Packets inside the byte array of a message: found natively, one table a packet type."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from analyzer import _native

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import numpy.typing as npt

    from dissectors.schema import Message, Packet

    Words = npt.NDArray[Any]

RECOGNIZED = 255
REASONS = ("no header", "unknown frame id", "truncated")


@dataclass(frozen=True, slots=True)
class FoundPackets:
    """The packets of one table in one batch.

    `rows` are rows of the carrying message's table, `offsets` (i32) cut the packets out of `data`; `columns` say where
    each lies and whether it is sound. Without `packet` the bytes are none that the profile knows.
    """

    table: str
    packet: Packet | None
    rows: Words
    columns: list[tuple[pa.Field, pa.Array]]
    offsets: bytes
    data: bytes


class PacketFinder:
    """Follows the packets of all messages of one dissector that carry any; headers of one may turn up in another."""

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
        """The packets in the rows of `table`, and the bytes that are none."""
        own = next((k for k, (m, _) in enumerate(self._carriers) if m.table == message.table), None)
        if own is None:
            return
        lists = table.column(self._carriers[own][1].field)
        _, offsets, _, values = lists.buffers()
        data = b"" if values is None else values.to_pybytes()
        senders = table.column("bus").to_numpy().tobytes(), table.column("src").to_numpy().tobytes()
        columns = self._native.find(own, message.type_id, offsets.to_pybytes(), data, senders)
        got = {name: np.frombuffer(columns[name], kind) for name, kind in _KINDS.items()}
        bounds = np.frombuffer(offsets, np.int32)
        raw = np.frombuffer(data, np.uint8)
        known = (got["spec"] >= 0) & (got["family"] != RECOGNIZED)
        for family, spec in sorted(set(zip(got["family"][known].tolist(), got["spec"][known].tolist(), strict=True))):
            here = np.flatnonzero(known & (got["family"] == family) & (got["spec"] == spec))
            packet = self._carriers[family][1].packets[spec]
            yield self._found(f"{message.table}.{packet.name}", packet, here, got, raw)
        rest = np.flatnonzero(~known & (np.diff(bounds)[got["row"]] > 0))
        if rest.size:
            yield self._found(f"{message.table}.unrecognized", None, rest, got, raw)

    def _found(
        self, table: str, packet: Packet | None, here: Words, got: dict[str, Words], raw: Words
    ) -> FoundPackets:
        starts, lengths = got["start"][here], got["len"][here]
        offsets = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int32)
        picks = np.repeat(starts - offsets[:-1], lengths) + np.arange(offsets[-1])
        data = raw[picks].tobytes()
        columns = [(pa.field("offset", pa.uint32(), metadata={"unit": "byte"}), pa.array(got["offset"][here]))]
        if packet is None:
            cut = pa.Array.from_buffers(pa.binary(), len(here), [None, pa.py_buffer(offsets), pa.py_buffer(data)])
            reason = pa.array([REASONS[code] for code in got["reason"][here].tolist()], pa.string())
            columns += [(pa.field("reason", pa.string()), reason), (pa.field("data", pa.binary()), cut)]
        else:
            columns += _verdicts(here, got)
        return FoundPackets(table, packet, got["row"][here], columns, offsets.tobytes(), data)


def _verdicts(here: Words, got: dict[str, Words]) -> list[tuple[pa.Field, pa.Array]]:
    flags = {name: got[name][here] != 0 for name in ("header_ok", "length_ok", "complete", "checksum_ok")}
    ok = flags["length_ok"] & flags["complete"] & flags["checksum_ok"]
    end = got["checksum_end"][here]
    columns = [
        ("packet_ok", pa.array(ok)),
        *((name, pa.array(flag)) for name, flag in flags.items()),
        ("checksum_end", pa.array(end, mask=end == 0)),
    ]
    for name in ("count_step", "count_step_id"):
        columns.append((name, pa.array(got[name][here], mask=got[f"{name}_valid"][here] == 0)))
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
