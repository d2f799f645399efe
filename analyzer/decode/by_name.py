"""Tables by name: the message or packet that a name means, and the columns of one that does not occur."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from analyzer.decode.messages import Messages
from analyzer.tables import KINDS, TRANSFERS

if TYPE_CHECKING:
    from dissectors import Registry
    from dissectors.schema import Message


def find_table(registry: Registry, name: str) -> tuple[Message, str]:
    """Return the message that a name means, and the table: its own, or a packet's. Raises `LookupError`."""
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
    known = [kind.name for family in registry.families() for kind in family.packets] + ["unrecognized"]
    if packet not in known:
        raise LookupError(f"{carrier.table} has no packet {packet!r} (one of: {', '.join(known)})")
    return carrier, f"{carrier.table}.{packet}"


def example(registry: Registry, message: Message) -> dict[str, pa.RecordBatch]:
    """Return the tables of one made-up transfer that has everything its type can have: for their columns."""
    payload = bytes(message.min_bytes)
    for family in registry.families() if message.packets is not None else ():
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
