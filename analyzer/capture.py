"""A capture as Python sees it: batches of Arrow tables, or one whole table by name."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

import dissectors
from analyzer.engine import Engine
from analyzer.messages import Messages
from analyzer.sources import Source
from analyzer.tables import FRAMES, KINDS, TRANSFERS

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from os import PathLike
    from pathlib import Path

    from analyzer.engine import Batch, Totals
    from analyzer.sources import CaptureError
    from dissectors import Registry
    from dissectors.schema import Message, PacketFamily


class Capture:
    """One file, decoded on the way through. Iterating gives `Batch` after `Batch`; each iteration reads it anew.

    Args:
        path: candump text in any dialect, gzip or not; `-` is standard input.
        dissectors: folders with further data types, before the built-in ones.

    Raises:
        CaptureError: the file cannot be read. Damage behind readable content is in `damage` instead.
    """

    def __init__(self, path: str | PathLike[str], dissectors_: Sequence[Path] = ()) -> None:
        self.path = str(path)
        self.registry = dissectors.load(dissectors_)
        self.source = Source(self.path)
        self.engine = Engine(self.registry)

    def __iter__(self) -> Iterator[Batch]:
        """Batches in capture order."""
        self.source = Source(self.path)
        self.engine = Engine(self.registry)
        yield from self.engine.run(self.source.chunks())

    def table(self, name: str) -> pa.Table:
        """All rows of one table: `frames`, `transfers`, `events`, a message type or a packet (`PUSHCAN.MotorStatus`).

        Verdicts of frames are the final ones. A type that does not occur gives its columns without rows. Raises
        `LookupError`, with near names, for a name that no type has, and `CaptureError`.
        """
        if name == "frames":
            return _settled(list(self))
        if name in ("transfers", "events"):
            return pa.Table.from_batches([getattr(batch, name) for batch in self])
        message, packet = self._find(name)
        wanted = message.table if packet is None else f"{message.table}.{packet}"
        pieces = [batch.messages[wanted] for batch in self if wanted in batch.messages]
        return pa.Table.from_batches(pieces or [example(self.registry, message)[wanted].slice(0, 0)])

    def _find(self, name: str) -> tuple[Message, str | None]:
        """A message, and the packet in it that is meant."""
        try:
            return self.registry.resolve(name), None
        except LookupError:
            outer, _, packet = name.rpartition(".")
            try:
                message = self.registry.resolve(outer)
            except LookupError:
                message = None
            if message is None or message.packets is None:
                raise
        known = [kind.name for family in families(self.registry) for kind in family.packets] + ["unrecognized"]
        if packet not in known:
            raise LookupError(f"{message.table} has no packet {packet!r} (one of: {', '.join(known)})")
        return message, packet

    @property
    def damage(self) -> CaptureError | None:
        """What ended the last reading early."""
        return self.source.damage

    @property
    def totals(self) -> Totals:
        """What became of every line and frame read so far."""
        return self.engine.totals

    @property
    def buses(self) -> tuple[str, ...]:
        """Interface names by the index in the `bus` columns."""
        return self.engine.buses


def open_capture(path: str | PathLike[str], dissectors: Sequence[Path] = ()) -> Capture:
    """Opens a capture; nothing is read before the first batch or table is asked for."""
    return Capture(path, dissectors)


def families(registry: Registry) -> list[PacketFamily]:
    """All packets there are: those of one message may turn up in another."""
    return [message.packets for message in registry.carriers() if message.packets is not None]


def example(registry: Registry, message: Message) -> dict[str, pa.RecordBatch]:
    """The tables of one made-up transfer that has everything its type can have: for their columns."""
    payload = bytes(message.min_bytes)
    for family in families(registry) if message.packets is not None else ():
        for packet in family.packets:
            data = bytearray(packet.length)
            data[: len(family.header)] = family.header
            data[family.id_at], data[family.length_at] = packet.id, packet.length
            payload += data
    payload += b"\0"  # behind the packets: unrecognized
    kind = KINDS.index(message.kind)
    kinds = iter(range(256))
    variant = next(v for v in kinds if registry.message(kind, message.type_id, v) == message)
    row = {"kind": kind, "type_id": message.type_id, "variant": variant, "fd": False, "status": 1}
    blank = dict.fromkeys(("t", "t_end", "bus", "src", "dst"), 0)
    transfers = pa.RecordBatch.from_pylist([blank | row | {"payload": payload}], schema=TRANSFERS)
    offsets = np.array([0, len(payload)], np.int32).tobytes()
    group = (message.kind != "message", message.type_id, variant, np.zeros(1, np.uint32).tobytes())
    return Messages(registry).decode(transfers, (offsets, payload), [group], 0)


def _settled(batches: list[Batch]) -> pa.Table:
    """The frames, with the verdicts that were found out later."""
    table = pa.Table.from_batches([batch.frames for batch in batches])
    late = pa.Table.from_batches([batch.settled for batch in batches]).combine_chunks()
    if not len(late):
        return table
    rows = late.column("frame").to_numpy()
    for name in ("verdict", "anomaly"):
        values = table.column(name).to_numpy().copy()
        found = late.column(name).to_numpy()
        values[rows] = found if name == "verdict" else values[rows] | found
        at = FRAMES.get_field_index(name)
        table = table.set_column(at, FRAMES.field(at), pa.array(values))
    return table
