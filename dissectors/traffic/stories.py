"""Stories: what happens in a flight, and the cause that is behind it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Callable
    from random import Random

    from dissectors.traffic.bus import World
    from dissectors.traffic.faults import Case


@dataclass(frozen=True, slots=True)
class Truth:
    """The cause that a story is about: its `kind`, and where; `channels` count from 1.

    `knowable` are the verdicts that a reader of the bus may come to first: it may not be able to tell some apart, or
    cannot tell at all (`unknown`). The cause began at `t` (ns), `stamp` by the recorder's clock; the bus has
    shown it `within` so many ns.
    """

    kind: str
    t: int
    stamp: int
    within: int
    knowable: tuple[str, ...]
    nodes: tuple[int, ...]
    channels: tuple[int, ...]


class Story(Protocol):
    """A scenario while it happens."""

    random: Random
    world: World
    vehicle: Any

    def tell(self, what: str) -> None:
        """Tell that `what` happens now."""

    def choose(self, option: str, likely: float) -> bool:
        """Return what was asked for by an option of the scenario, else what the dice say."""

    def settle(
        self,
        kind: str,
        knowable: tuple[str, ...] = (),
        *,
        nodes: tuple[int, ...] = (),
        channels: tuple[int, ...] = (),
        within: int = 0,
    ) -> None:
        """Tell the true cause of what comes, from now on, which the bus shows `within` so many ns; see `Truth`.

        Without `knowable` the cause alone is right.
        """

    def case(self, rule: str, done: str, also: tuple[str, ...] = ()) -> Case:
        """Return a breach of `rule` that the story brings: an answer of its own in the key, from now on."""


@dataclass(frozen=True, slots=True)
class Scenario:
    """A story that a capture tells; `start` lets it happen in a flight of its `flight` with at `least` some ESCs.

    A capture without any of its `rules` does not tell it. `options` are what may be said to be so or not so, which
    the dice decide otherwise.
    """

    name: str
    title: str
    story: str
    start: Callable[[Story], None]
    flight: str = "hover"
    seconds: float = 8.0
    least: int = 1
    rules: tuple[str, ...] = ()
    options: tuple[str, ...] = ()
