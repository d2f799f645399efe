"""Simulated flights for tests: every recorded frame, and every transfer whose last frame was recorded."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any

from witness.flights import registry

from analyzer.simulate import Settings, Simulation
from analyzer.simulate.text import line
from dissectors.tmotor.traffic.packets import split
from dissectors.traffic import SECOND

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.tmotor.traffic import Vehicle
    from dissectors.traffic import Frame, Sending

PROFILES = ("hover", "mission", "bench", "startup")


def simulation(seconds: float = 6, **settings: Any) -> Simulation:
    return Simulation(Settings(duration=round(seconds * SECOND), **settings), registry())


@dataclass(eq=False)
class Flown:
    """What became of a simulation; times in ns."""

    simulation: Simulation
    frames: list[Frame] = field(init=False)

    def __post_init__(self) -> None:
        self.frames = list(self.simulation.frames())

    @property
    def vehicle(self) -> Vehicle:
        return self.simulation.vehicle

    @property
    def escs(self) -> range:
        """Their node IDs."""
        return range(11, 11 + self.simulation.settings.escs)

    @cached_property
    def text(self) -> str:
        return "".join(line(frame, self.simulation.settings.start, ("can0", "can1")) for frame in self.frames)

    @cached_property
    def sent(self) -> list[Sending]:
        """In the order of their last frames."""
        return [frame.sending for frame in self.frames if frame.sending and frame is frame.sending.frames[-1]]

    def of(self, name: str, node: int | None = None) -> list[Sending]:
        """The transfers of a type, of one node or of all."""
        return [one for one in self.sent if one.name == name and node in {None, one.node}]

    def packets(self, name: str, node: int | None = None) -> Iterator[tuple[Sending, dict[str, Any]]]:
        """Every packet of a name with the transfer that carries it."""
        for carrier in ("PUSHSCI", "PUSHCAN"):
            for one in self.of(carrier, node):
                found, values = split(one.values["data"])
                if found == name:
                    yield one, values


@lru_cache(maxsize=24)
def flown(seconds: float = 6, **settings: Any) -> Flown:
    """A flight that tests share."""
    return Flown(simulation(seconds, **settings))


def end(sending: Sending) -> int:
    """When its last frame was on the bus."""
    return sending.frames[-1].t


def peak(times: list[int], window: int = SECOND) -> int:
    """The most events in any window."""
    first = most = 0
    for last, t in enumerate(times):
        while times[first] <= t - window:
            first += 1
        most = max(most, last - first + 1)
    return most


def status_bits(sending: Sending) -> tuple[int, int, int]:
    """Fault bits, operating mode and encoder of an ESCStatus (4.4.3)."""
    word = sending.values["error_count"]
    return word & 0xFFF, word >> 12 & 15, word >> 16
