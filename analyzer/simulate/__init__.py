"""Traffic with known faults: a bus, a vehicle on it, faults that are asked for, and a key that says where they are.

Nothing in here decodes: payloads, frames, arbitration and stuffing are a sender's, written apart from the analyzer that
they are to test. What a vendor's devices do comes from the vendor's folder, in the terms of `dissectors.traffic`.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from analyzer.simulate.faults import catalogue
from analyzer.simulate.plot import Story
from analyzer.simulate.recorder import Recorder
from analyzer.simulate.world import World
from dissectors.tmotor import traffic
from dissectors.traffic import SECOND

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    from analyzer.simulate.faults.desk import Order
    from dissectors.registry import Registry
    from dissectors.traffic import Frame

# 2026-03-14 08:02:10 UTC, so that the same settings give the same bytes on any day.
START = 1_773_475_330 * SECOND


@dataclass(frozen=True, slots=True)
class Settings:
    """What to simulate. `duration` in ns, `start` in ns since 1970.

    `rate` of status messages in Hz; None is what suits the bit rate, 30 at 1 Mbit/s.
    Faults without a time of their own happen within the first `span` ns, 0 for the whole duration.
    """

    profile: str = "hover"
    scenario: str = ""
    escs: int = 4
    duration: int = 10 * SECOND
    seed: int = 1
    bit_rate: int = 1_000_000
    rate: int | None = None
    stock: bool = False
    start: int = START
    bus: str = "can0"
    orders: tuple[Order, ...] = field(default_factory=tuple)
    span: int = 0

    @property
    def buses(self) -> tuple[str, str]:
        """The interface, and a second one, which only some faults use: can1 beside can0."""
        name, digits, _ = re.split(r"(\d*)$", self.bus, maxsplit=1)
        return self.bus, f"{name}{int(digits) + 1}" if digits else f"{name}2"


class Simulation:
    """One run; the same settings give the same frames.

    The key is about the frames that `frames` has given so far.
    """

    def __init__(self, settings: Settings, registry: Registry) -> None:
        self.settings = settings
        self.recorder = Recorder()
        self.world = World(
            registry, bit_rate=settings.bit_rate, end=settings.duration, seed=settings.seed, span=settings.span
        )
        self.vehicle = traffic.build(
            self.world,
            traffic.Wishes(settings.profile, settings.escs, settings.rate, settings.stock),
        )
        self.world.desk.vehicle = self.vehicle
        for number, order in enumerate(settings.orders):
            self.world.desk.take(order, World.dice(f"fault {number}", settings.seed))
        self.scenario = catalogue.scenario(settings.scenario) if settings.scenario else None
        self.story = Story(self.world, self.vehicle, World.dice("scenario", settings.seed))
        if self.scenario is not None:
            self.scenario.start(self.story)

    @property
    def size(self) -> int:
        """Nanoseconds simulated so far."""
        return self.world.now

    @property
    def length(self) -> int:
        """Nanoseconds to simulate."""
        return self.settings.duration

    @property
    def unused(self) -> tuple[str, ...]:
        """Faults that were asked for and are not in what was recorded, as they were written."""
        return tuple(dict.fromkeys(order.text or order.fault.rule for order in self.world.desk.unseen))

    @property
    def untold(self) -> tuple[str, ...]:
        """The rules of the scenario that nothing recorded breaks: without them it has not been told."""
        wanted = self.scenario.rules if self.scenario is not None else ()
        return tuple(rule for rule in wanted if all(rule != answer.rule for answer in self.world.desk.answers))

    def frames(self, pace: Callable[[Iterator[Frame]], Iterable[Frame]] = iter) -> Iterator[Frame]:
        """Every recorded frame in order; times from the start of the simulation.

        `pace` may hold back what is on the bus, and end it: the rest was not recorded.
        """
        yield from self.recorder.record(pace(self.world.run()))

    def key(self) -> Mapping[str, Any]:
        """The answer key, ready for JSON."""
        from analyzer.simulate.key import key  # noqa: PLC0415 - only those who want it

        return key(self)
