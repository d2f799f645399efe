"""A scenario at work: what it lets happen, and the story of it in the answer key."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from analyzer.simulate.faults.desk import Work
from dissectors.traffic import Fault

if TYPE_CHECKING:
    from random import Random

    from analyzer.simulate.world import World
    from dissectors import traffic


class Story:
    """The `Plot` that a scenario sees; `events` are (time in ns, what happened)."""

    def __init__(self, world: World, vehicle: Any, random: Random) -> None:
        self.world: traffic.World = world
        self.vehicle = vehicle
        self.random = random
        self.events: list[tuple[int, str]] = []
        self._desk = world.desk

    def tell(self, what: str) -> None:
        """The story goes on: `what` happens now."""
        self.events.append((self.world.now, what))

    def case(self, rule: str, done: str, also: tuple[str, ...] = ()) -> Work:
        """A breach of `rule` that the story brings: an answer of its own in the key, from now on."""
        return Work(self._desk, Fault(rule, done, also=also), self.random)
