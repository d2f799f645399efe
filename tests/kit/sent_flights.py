"""Simulated flights as the tests of faults look at them: the key, and every transfer as its sender sent it."""

from __future__ import annotations

import struct
from functools import cache
from typing import TYPE_CHECKING, Any

from witness.flights import registry

from analyzer.simulate import Simulation, SimulationSettings
from analyzer.simulate.faults import catalogue
from dissectors.times import SECOND

if TYPE_CHECKING:
    from dissectors.traffic import Sending


class Flight:
    """A short simulation: its key, and every transfer that was recorded, in the order of sending."""

    def __init__(self, orders: tuple[str, ...], seconds: float, escs: int, plan: str = "hover") -> None:
        asked = tuple(catalogue.order(text) for text in orders)
        self.simulation = Simulation(
            SimulationSettings(flight=plan, escs=escs, duration=round(seconds * SECOND), orders=asked),
            registry(),
        )
        self.frames = list(self.simulation.frames())
        self.key = self.simulation.key()
        seen = {id(frame.sending): frame.sending for frame in self.frames if frame.sending is not None}
        self.sent = sorted(seen.values(), key=lambda sending: (sending.t, sending.node, sending.name))

    def answer(self, rule: str) -> dict[str, Any]:
        (found,) = (fault for fault in self.key["faults"] if fault["rule"] == rule)
        return dict(found)

    def shown(self, rule: str) -> list[Sending]:
        """The transfers whose frames the answer lists; it lists all frames of each."""
        numbers = set(self.answer(rule)["frames"])
        found = [one for one in self.sent if {frame.number for frame in one.frames} & numbers]
        recorded = {frame.number for one in found for frame in one.frames if frame.number}
        assert recorded == numbers
        return found

    def of(self, name: str, node: int | None = None) -> list[Sending]:
        return [one for one in self.sent if one.name == name and node in (None, one.node)]


@cache
def flight(*orders: str, seconds: float = 4.0, escs: int = 4, plan: str = "hover") -> Flight:
    return Flight(orders, seconds, escs, plan)


def word(sending: Sending) -> int:
    return int.from_bytes(sending.payload[:4], "little")


def codes(sending: Sending) -> tuple[int, ...]:
    return struct.unpack_from("<3H", sending.payload, 4)
