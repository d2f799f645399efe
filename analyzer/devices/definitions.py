"""The subject of a table: the message or the packet that gives its columns their meaning."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dissectors import Registry
    from dissectors.schema import Message, Packet


class Definitions:
    """Looks them up once each."""

    def __init__(self, registry: Registry) -> None:
        self._registry = registry
        self._packets: dict[str, Packet] = {
            f"{message.table}.{packet.name}": packet
            for message in registry.carriers()
            if message.packets is not None
            for packet in message.packets.packets
        }
        self._known: dict[str, Message | Packet | None] = {}

    def message(self, table: str) -> Message | None:
        """Return the message of a table, None if it is one of packets."""
        if table in self._packets or table not in self._registry.names():
            return None
        return self._registry.resolve(table)

    def of(self, table: str) -> Message | Packet | None:
        """Return the message or packet of a table, None if nothing defines it."""
        if table not in self._known:
            self._known[table] = self._packets.get(table) or self.message(table)
        return self._known[table]

    def table_of(self, path: str) -> str:
        """Return the table whose name, and a dot, a path to a column begins with; empty if nothing defines one."""
        parts = path.split(".")
        names = (".".join(parts[:size]) for size in range(len(parts) - 1, 0, -1))
        return next((name for name in names if self.of(name) is not None), "")
