"""A scenario at work: what it lets happen, and the story of it in the answer key."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.simulate.faults.context import ActiveFault
from dissectors.traffic import Fault

if TYPE_CHECKING:
    from random import Random

    from analyzer.simulate.faults.context import FaultContext


class RecordedStory:
    """The `Story` that a scenario sees; `events` are (time in ns, what happened)."""

    def __init__(self, context: FaultContext, random: Random) -> None:
        self.world, self.vehicle, self.random = context.world, context.vehicle, random
        self.events: list[tuple[int, str]] = []
        self._context = context

    def tell(self, what: str) -> None:
        """Note that `what` happens now."""
        self.events.append((self.world.now, what))

    def case(self, rule: str, done: str, also: tuple[str, ...] = ()) -> ActiveFault:
        """Return a breach of `rule` that the story brings: an answer of its own in the key, from now on."""
        return ActiveFault(self._context, Fault(rule, done, also=also), self.random)
