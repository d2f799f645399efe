"""The words and numbers that a vehicle file may use, by the data types that there are."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

from analyzer.facts.names import short
from analyzer.rules.exercised.coverage import described

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors import Registry
    from dissectors.schema import Derived, Message, Note, Packet

CHANNEL, UNIT = "channel", "unit"  # columns by which profiles number ESCs for people, and power units


class Vocabulary:
    """Names of types and packets, and the numbers of units, as the profiles have them."""

    def __init__(self, registry: Registry) -> None:
        self._registry = registry

    def message(self, name: str) -> str:
        """Return the name of a type in full. Raises `LookupError` with names that are near."""
        return self._registry.resolve(name).name

    def table(self, name: str) -> str:
        """Return the table of a type, or the name of a packet. Raises `LookupError` with names that are near."""
        packet = name.rpartition(".")[2]
        return packet if name in self._packets else self._registry.resolve(name).table

    def covered(self, name: str) -> str:
        """Return a type as findings name it; also one that is known by its number alone. Raises `LookupError`."""
        kind, _, number = name.rpartition(" ")
        return name if kind in ("type", "service") and number.isdecimal() else short(self.table(name))

    @cached_property
    def units(self) -> range | None:
        """The numbers that a power unit can have; None if no profile says."""
        limits = [limit for packet in self._inner for limit in _limits(packet, UNIT)]
        return range(min(low for low, _ in limits), max(high for _, high in limits) + 1) if limits else None

    @cached_property
    def escs(self) -> int | None:
        """Return how many ESCs a bus can have; None if no profile says."""
        counts = [high - low + 1 for message in described(self._registry) for low, high in _limits(message, CHANNEL)]
        return max(counts, default=None)

    @cached_property
    def _inner(self) -> list[Packet]:
        return [packet for family in self._registry.families() for packet in family.packets]

    @cached_property
    def _packets(self) -> frozenset[str]:
        """Names of packets, alone and behind the message that carries them."""
        carriers = [message.table for message in self._registry.carriers()]
        names = [packet.name for packet in self._inner]
        return frozenset([*names, *(f"{carrier}.{name}" for carrier in carriers for name in names)])


def _limits(of: Message | Packet, column: str) -> Iterator[tuple[int, int]]:
    """Yield the raw limits of what a column is computed from."""
    sources: dict[str, Derived] = {one.name: one for one in of.derived}
    note: Note | None = of.notes.get(sources[column].source) if column in sources else None
    if note is not None and note.low is not None and note.high is not None:
        yield int(note.low), int(note.high)
