"""What a capture exercised, in the words that pages use for what a rule needs."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

    from analyzer.rules.view import View
    from dissectors import Registry
    from dissectors.conformance import Exercise


class Exercises:
    """Collects words over batches.

    Args:
        registry: the types that the capture is decoded with.
        more: what dissectors bring along.
    """

    def __init__(self, registry: Registry, more: Iterable[type[Exercise]]) -> None:
        self._registry = registry
        self._more = [kind() for kind in more]
        self._words: set[str] = set()

    def look(self, view: View) -> None:
        """The next batch."""
        for one in self._more:
            one.look(view)

    def words(self) -> frozenset[str]:
        """What was there."""
        return frozenset(self._words.union(*(one.words() for one in self._more)))
