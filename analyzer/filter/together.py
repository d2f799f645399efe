"""Tables that belong together: halves of a service, packets inside a message."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dissectors.schema import Message

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from dissectors.schema import Packet

_HALVES = (".Request", ".Response")


def carried(of: Message | Packet) -> Iterator[str]:
    """Give the packets inside a message."""
    family = of.packets if isinstance(of, Message) else None
    return iter(()) if family is None else (packet.name for packet in family.packets)


def _half(table: str) -> str:
    for half in _HALVES:
        if table.endswith(half):
            return table.removesuffix(half)
    return table


def same(tables: Mapping[str, object]) -> bool:
    """Return whether tables are of one type: halves of a service, or a packet in several messages."""
    names = {_half(table) for table in tables}
    return len(names) == 1 or (
        len({name.rpartition(".")[2] for name in names}) == 1
        and all("." in n for n in names)
        and not any(n.count(".") > 1 for n in names)
    )
