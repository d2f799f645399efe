"""Flights with faults as candump text."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from flown import Flown, simulation

from analyzer.simulate.faults import catalogue

SEED = 5


@lru_cache(maxsize=16)
def flight(*orders: str, seconds: float = 4, seed: int = SEED, **settings: Any) -> str:
    """What `tailbyte simulate` writes with faults given as on its command line; each of them finds its occasion."""
    wanted = tuple(catalogue.order(order) for order in orders)
    flown = Flown(simulation(seconds, seed=seed, orders=wanted, **settings))
    assert flown.simulation.unused == ()
    return flown.text
