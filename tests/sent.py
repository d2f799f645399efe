"""Captures for the tests of rules: flights of the simulator with faults, and what the witness says of them."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from judged import registry
from witness.proof import finder
from witness.reader import Log

from analyzer.simulate import Settings, Simulation
from analyzer.simulate.faults import catalogue
from analyzer.simulate.text import line

if TYPE_CHECKING:
    from collections.abc import Iterable

    from judged import Said


@cache
def flight(*orders: str, seconds: int = 3) -> str:
    """What `tailbyte simulate` writes with these faults; each of them finds its occasion."""
    wanted = tuple(catalogue.order(order) for order in orders)
    run = Simulation(Settings(duration=seconds * 10**9, orders=wanted), registry())
    text = "".join(line(frame, run.settings.start, ("can0", "can1")) for frame in run.frames())
    assert run.unused == ()
    return text


def witnessed(rule: str, text: str, said: Iterable[Said]) -> bool:
    """Are the places of a rule's findings those that the independent witness finds?"""
    mine = [one for one in said if one.rule == rule]
    wanted = sorted(min(frames) for frames in finder(rule)(Log(text)))
    return sorted(frame for one in mine for frame in one.frames) == wanted
