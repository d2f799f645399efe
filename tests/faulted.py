"""Flights with faults as text for the judge, and as the witness reads them."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

from judged import judge, registry
from witness.proof import finder
from witness.reader import Log

from analyzer.simulate import Settings, Simulation
from analyzer.simulate.faults import catalogue
from analyzer.simulate.text import line

if TYPE_CHECKING:
    from judged import Said

SECOND = 10**9
CASES = (1, 7)


@cache
def faulted(*orders: str, seconds: int = 10, **settings: Any) -> str:
    """What `tailbyte simulate` writes, with faults given as on its command line."""
    wanted = tuple(catalogue.order(order) for order in orders)
    run = Simulation(Settings(duration=seconds * SECOND, orders=wanted, **settings), registry())
    return "".join(line(frame, run.settings.start, ("can0", "can1")) for frame in run.frames())


def agrees(rule: str, seed: int) -> list[Said]:
    """The findings of a fault's rule: each is one of the witness's and the other way round, in any batch size."""
    text = faulted(f"{rule}@5", seed=seed)
    proofs = finder(rule)(Log(text))
    found = judge(text, (rule,))
    assert proofs
    assert found
    assert all(any(proof & set(one.frames) for one in found) for proof in proofs)
    assert all(any(frame in proof for proof in proofs) for one in found for frame in one.frames[:1])
    assert judge(text, (rule,), step=7) == found
    return found
