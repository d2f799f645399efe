"""What the rules say of a simulated flight, compared with what the witness finds in its bytes."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any

from flown import Flown, simulation
from judged import judge
from witness.proof import finder
from witness.reader import Log

from analyzer.simulate.faults import catalogue

if TYPE_CHECKING:
    from judged import Said

SEED = 5
MOST_EXAMPLES = 20


@lru_cache(maxsize=8)
def flight(*orders: str, seconds: float = 4, **settings: Any) -> tuple[str, Log]:
    """The text of a flight with faults, and the same as the witness reads it."""
    wanted = tuple(catalogue.order(order) for order in orders)
    text = Flown(simulation(seconds, orders=wanted, seed=SEED, **settings)).text
    return text, Log(text)


def proved(rule: str, *orders: str, each: bool = True, **settings: Any) -> list[Said]:
    """The findings of a rule: every one is proved by the witness, and nothing that it proves is missing.

    Args:
        rule: the rule.
        orders: faults of the flight.
        each: whether there is an occurrence for each transfer that the witness names; else one that they share.
        settings: of the flight.
    """
    text, log = flight(*orders, **settings)
    said = judge(text, (rule,))
    wanted = finder(rule)(log)
    shown = [frame for one in said for frame in one.frames]
    assert wanted
    assert all(any(frame in proof for proof in wanted) for frame in shown)
    if each:
        assert {frame for one in said for frame in one.frames} >= {min(proof) for proof in wanted[:MOST_EXAMPLES]}
    else:
        assert all(proof & set(shown) for proof in wanted)
    assert judge(text, (rule,), step=401) == said
    return said
