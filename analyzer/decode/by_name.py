"""Tables by name: the message or packet that a name means, and the columns of one that does not occur."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer._native import Group
from analyzer.decode.messages import Messages
from analyzer.decode.packets import UNRECOGNIZED
from analyzer.tables import KINDS

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pyarrow as pa

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
    known = [kind.name for family in registry.families() for kind in family.packets] + [UNRECOGNIZED]
    if packet not in known:
        raise LookupError(f"{carrier.table} has no packet {packet!r} (one of: {', '.join(known)})")
    return carrier, f"{carrier.table}.{packet}"


def example(registry: Registry, message: Message) -> Mapping[str, pa.RecordBatch]:
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
    variant = next(v for v in range(256) if registry.message(kind, message.type_id, v) == message)
    messages = Messages(registry)
    return messages.told(messages.read([Group.example(kind, message.type_id, variant, payload)], 0, last=False))
