"""A scenario at work: what it lets happen, and the story of it in the answer key."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.simulate.faults.context import ActiveFault
from dissectors.traffic import Fault, Truth

if TYPE_CHECKING:
    from collections.abc import Mapping
    from random import Random

    from analyzer.simulate.faults.context import FaultContext


class RecordedStory:
    """The `Story` that a scenario sees; `options` are what was asked for.

    `events` are (time in ns, the same by the recorder's clock, what happened).
    """

    def __init__(self, context: FaultContext, random: Random, options: Mapping[str, bool]) -> None:
        self.world, self.vehicle, self.random = context.world, context.vehicle, random
        self.events: list[tuple[int, int, str]] = []
        self.truth: Truth | None = None
        self._options = options
        self._context = context

    def tell(self, what: str) -> None:
        """Note that `what` happens now."""
        self.events.append((self.world.now, self.world.stamp(), what))

    def choose(self, option: str, likely: float) -> bool:
        """Return what was asked for by an option, else what the dice say; these are thrown in any case."""
        thrown = self.random.random() < likely
        return self._options.get(option, thrown)

    def settle(
        self,
        kind: str,
        knowable: tuple[str, ...] = (),
        *,
        nodes: tuple[int, ...] = (),
        channels: tuple[int, ...] = (),
        within: int = 0,
    ) -> None:
        """Note the true cause, from now on."""
        world = self.world
        self.truth = Truth(kind, world.now, world.stamp(), within, knowable or (kind,), nodes, channels)

    def case(self, rule: str, done: str, also: tuple[str, ...] = ()) -> ActiveFault:
        """Return a breach of `rule` that the story brings: an answer of its own in the key, from now on."""
        return ActiveFault(self._context, Fault(rule, done, also=also), self.random)
