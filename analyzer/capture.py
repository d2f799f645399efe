"""A capture as Python sees it: batches of Arrow tables, or one whole table by name."""

from __future__ import annotations

from os import PathLike
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

import dissectors
from analyzer.engine import Engine
from analyzer.messages import Messages
from analyzer.sources.merge import Plan, open_captures
from analyzer.tables import FRAMES, KINDS, TRANSFERS

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    from analyzer.engine import Batch, Totals
    from analyzer.sources import CaptureError
    from dissectors import Registry
    from dissectors.schema import Message, PacketFamily


class Capture:
    """A capture, decoded on the way through. Iterating gives `Batch` after `Batch`; each iteration reads it anew.

    Args:
        paths: files of any format, packed or not, merged by time; `-` is standard input.
        plan: names of buses and shifts of clocks.
        dissectors: folders with further data types, before the built-in ones.

    Raises:
        CaptureError: a file cannot be read. Damage behind readable content is in `damage` instead.
        MergeError: the captures have no clock in common.
    """

    def __init__(self, paths: Sequence[str], plan: Plan | None = None, dissectors_: Sequence[Path] = ()) -> None:
        self.registry = dissectors.load(dissectors_)
        self.source = open_captures(paths, plan)
        self.engine = Engine(self.registry)

    def __iter__(self) -> Iterator[Batch]:
        """Batches in capture order."""
        self.source = self.source.again()
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
        message, wanted = find_table(self.registry, name)
        pieces = [batch.messages[wanted] for batch in self if wanted in batch.messages]
        return pa.Table.from_batches(pieces or [example(self.registry, message)[wanted].slice(0, 0)])

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


def open_capture(
    path: str | PathLike[str] | Sequence[str | PathLike[str]],
    dissectors: Sequence[Path] = (),
    *,
    buses: Mapping[str, str] | None = None,
    offsets: Mapping[str, int] | None = None,
    same_bus: bool = False,
) -> Capture:
    """Opens a capture, or several as one; nothing is read before the first batch or table is asked for.

    `buses` gives names: of a capture, of an interface, or of `capture:interface`. `offsets` shifts the clocks of
    captures, in nanoseconds. With `same_bus` all of them recorded one bus, and what repeats is left out.
    """
    paths = [path] if isinstance(path, (str, PathLike)) else path
    return Capture([str(p) for p in paths], Plan(dict(buses or {}), dict(offsets or {}), same_bus), dissectors)


def find_table(registry: Registry, name: str) -> tuple[Message, str]:
    """The message that is meant, and the table: its own, or that of a packet in it. Raises `LookupError`."""
    try:
        message = registry.resolve(name)
    except LookupError:
        outer, _, packet = name.rpartition(".")
        try:
            carrier: Message | None = registry.resolve(outer)
        except LookupError:
            carrier = None
        if carrier is None or carrier.packets is None:
            raise
    else:
        return message, message.table
    known = [kind.name for family in families(registry) for kind in family.packets] + ["unrecognized"]
    if packet not in known:
        raise LookupError(f"{carrier.table} has no packet {packet!r} (one of: {', '.join(known)})")
    return carrier, f"{carrier.table}.{packet}"


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
