"""Flights for the witness: what `tailbyte simulate` would write, as a `Log`, with the answer key to it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any

import dissectors
from analyzer.simulate import Settings, Simulation
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


@cache
def registry() -> Registry:
    return dissectors.load()


def fly(*orders: str, rates: Sequence[str] = (), seconds: float = 10, **settings: Any) -> Flight:
    """A flight with faults and fault rates, written as on the command line; `settings` as `Settings` has them."""
    wanted = (*(catalogue.order(order) for order in orders), *(catalogue.rate(order) for order in rates))
    run = Simulation(Settings(duration=round(seconds * SECOND), orders=wanted, **settings), registry())
    text = "".join(line(frame, run.settings.start, ("can0", "can1")) for frame in run.frames())
    return Flight(Log(text), run.key(), run.unused)


@lru_cache(maxsize=16)
def clean(seconds: float = 10, **settings: Any) -> Flight:
    """The same without faults."""
    return fly(seconds=seconds, **settings)
