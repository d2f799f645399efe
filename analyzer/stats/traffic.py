"""Senders and what they send: frames and transfers by type. The hierarchy and the talkers share it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.facts.names import type_name
from analyzer.facts.traffic import Talk, Talks
from analyzer.stats.sums import FrameSums
from analyzer.tables import KINDS

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.stats.chosen import ChosenBatch
    from analyzer.stats.sums import FrameSum, SumKey
    from dissectors import Registry

Sender = tuple[int, int, int, int]  # bus, node, kind, type ID
_MESSAGE = KINDS.index("message")


def type_of(registry: Registry, kind: int, type_id: int) -> str:
    """Return the name of the preferred type with an ID."""
    return type_name(registry.message(kind, type_id, 0), kind, type_id)


class SenderTraffic:
    """Adds up batches; bounded as `FrameSums` and `Talks` are."""

    def __init__(self, registry: Registry) -> None:
        self._registry = registry
        self._sums, self._talks = FrameSums(), Talks()
        self._variants: dict[tuple[int, int], int] = {}

    def feed(self, batch: ChosenBatch) -> None:
        """Add the next batch."""
        self._sums.feed(batch)
        self._talks.feed(batch.whole.transfers)

    def frames(self) -> Iterator[tuple[SumKey, FrameSum]]:
        """Yield frames by interface, sender, type and verdict."""
        return self._sums.all({(bus, of[1]) for bus, src, of in self._talks.all if not src and of[0] == _MESSAGE})

    @property
    def beyond(self) -> int:
        """Transfers beyond the bound, which are only counted together."""
        return self._talks.beyond

    def transfers(self) -> dict[Sender, Talk]:
        """Return transfers by sender and type, whichever of the types with this ID they were."""
        found: dict[Sender, Talk] = {}
        often: dict[tuple[int, int], dict[int, int]] = {}
        for (bus, src, (kind, type_id, variant)), talk in sorted(self._talks.all.items()):
            one = found.setdefault((bus, src, kind, type_id), Talk())
            one.count += talk.count
            one.bad += talk.bad
            one.first = min((t for t in (one.first, talk.first) if t is not None), default=None)
            one.last = max((t for t in (one.last, talk.last) if t is not None), default=None)
            counts = often.setdefault((kind, type_id), {})
            counts[variant] = counts.get(variant, 0) + talk.count
        self._variants = {of: max(counts, key=lambda variant: counts[variant]) for of, counts in often.items()}
        return found

    def name(self, kind: int, type_id: int) -> str:
        """Return the name of a type, of several with one ID that which occurs most."""
        message = self._registry.message(kind, type_id, self._variants.get((kind, type_id), 0))
        return type_name(message, kind, type_id)
