"""What faults of simulated flights share: which messages are meant, and what becomes of them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from bench.outside.flight import DOWN, RISE, text_of
from bench.outside.kinds import Case

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from random import Random

    from bench.outside.flight import Flight, Message

sent = replace
HOVER = RISE + 300, DOWN - 300  # ms in which all motors turn steadily


def moment(rng: Random) -> int:
    """In ms."""
    return rng.randrange(*HOVER)


def esc(flight: Flight, rng: Random) -> int:
    return rng.choice(flight.nodes)


def fitting(flight: Flight, fit: Callable[[Message], bool]) -> list[Message]:
    """Messages in hover, by time."""
    return sorted((m for m in flight.messages if HOVER[0] < m.t < HOVER[1] and fit(m)), key=lambda m: m.t)


def one_of(flight: Flight, rng: Random, fit: Callable[[Message], bool]) -> Message:
    return rng.choice(fitting(flight, fit))


def few(flight: Flight, rng: Random, fit: Callable[[Message], bool]) -> list[Message]:
    """One to five that follow each other."""
    found, size = fitting(flight, fit), rng.randrange(1, 6)
    begin = rng.randrange(len(found) - size)
    return found[begin : begin + size]


def altered(
    flight: Flight, chosen: Iterable[Message], new: Callable[[Message], Message], *nodes: int, about: str = ""
) -> Case:
    mine = set(chosen)
    return case(flight, flight.made(lambda m: new(m) if m in mine else m), *nodes, about=about)


def without(flight: Flight, gone: Callable[[Message], bool], *nodes: int, about: str = "") -> Case:
    return case(flight, flight.made(lambda m: None if gone(m) else m), *nodes, about=about)


def case(flight: Flight, messages: list[Message], *nodes: int, about: str = "", extra: Any = ()) -> Case:
    return Case(text_of(messages, extra), frozenset(nodes), f"{flight.escs} ESCs, {about}")
