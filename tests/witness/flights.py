"""Flights for the witness: what `tailbyte simulate` would write, as a `Log`, with the answer key to it."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any

import dissectors
from analyzer.simulate import Simulation, SimulationSettings
from analyzer.simulate.faults import catalogue
from analyzer.simulate.text import line
from witness.reader import Log

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dissectors.registry import Registry

SECOND = 10**9


@dataclass(frozen=True, slots=True, eq=False)
class Flight:
    """A capture, its answer key, and the faults that found no occasion."""

    log: Log
    key: Mapping[str, Any]
    unused: tuple[str, ...]

    def answers(self, rule: str) -> list[dict[str, Any]]:
        """The entries of a rule in the key."""
        return [entry for entry in self.key["faults"] if entry["rule"] == rule]

    def unlisted(self, same: Flight) -> Counter[tuple[int, bytes]]:
        """Return the frames that neither the key lists nor the same flight without the fault has."""
        listed = {number for answer in self.key["faults"] for number in answer["frames"]}
        frames = Counter((frame.id, frame.data) for frame in self.log.frames if frame.number not in listed)
        return frames - Counter((frame.id, frame.data) for frame in same.log.frames)


@cache
def registry() -> Registry:
    return dissectors.load()


def fly(*orders: str, rates: Sequence[str] = (), seconds: float = 10, **settings: Any) -> Flight:
    """A flight with faults and fault rates, as on the command line; `settings` as `SimulationSettings` has them."""
    wanted = (*(catalogue.order(order) for order in orders), *(catalogue.rate(order) for order in rates))
    run = Simulation(SimulationSettings(duration=round(seconds * SECOND), orders=wanted, **settings), registry())
    text = "".join(line(frame, run.settings.start, ("can0", "can1")) for frame in run.frames())
    return Flight(Log(text), run.key(), run.unused)


@lru_cache(maxsize=4)
def clean(seconds: float = 10, **settings: Any) -> Flight:
    """The same without faults."""
    return fly(seconds=seconds, **settings)
