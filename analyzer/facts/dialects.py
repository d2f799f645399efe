"""The readings of doubtful fields that nodes use, as they were found out while a capture was decoded."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dissectors.schema import BYTE_ORDERS

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from analyzer.decode.engine import Batch
    from analyzer.decode.readings import Statement
    from dissectors import Registry


def checked(dialects: Mapping[int, Collection[str]], registry: Registry) -> Mapping[int, Collection[str]]:
    """Return the same dialects. Raises `ValueError` for a choice that no doubtful field has."""
    if not dialects:
        return dialects
    choices = [one for message in registry.doubtful() for reading in message.readings for one in reading.choices]
    proved = any(note.agrees for packet in registry.packets.values() for note in packet.notes.values())
    choices += BYTE_ORDERS if proved else ()
    for node, given in dialects.items():
        for choice in given:
            if choice not in choices:
                known = f"one of: {', '.join(dict.fromkeys(choices))}" if choices else "no field is doubtful"
                raise ValueError(f"dialect {node}={choice}: no field is read as {choice!r} ({known})")
    return dialects


class Dialects:
    """The statements on all nodes, as the latest batch has them."""

    def __init__(self) -> None:
        self.statements: tuple[Statement, ...] = ()
        self._choices: dict[tuple[str, str, int, int], str] = {}

    def feed(self, batch: Batch) -> None:
        """Add the next batch."""
        if batch.readings != self.statements:
            self.statements = batch.readings
            self._choices = {(one.message, one.reading, one.bus, one.node): one.choice for one in batch.readings}

    def choice(self, message: str, reading: str, bus: int, node: int) -> str:
        """Return what one node's reading of a message's field is so far, empty if nothing is known."""
        return self._choices.get((message, reading, bus, node), "")
