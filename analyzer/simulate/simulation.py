"""One simulation: a bus, the vehicle on it, the faults that were asked for, and the recorder."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from analyzer.simulate.faults import catalogue
from analyzer.simulate.key import build_key, describe_story
from analyzer.simulate.recorder import SimulatedRecorder
from analyzer.simulate.story import RecordedStory
from analyzer.simulate.world import SimulatedWorld
from dissectors.tmotor import traffic

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    from analyzer.simulate.settings import SimulationSettings
    from dissectors.registry import Registry
    from dissectors.traffic import SimulatedFrame


class Simulation:
    """One run; the same settings give the same frames.

    The key is about the frames that `frames` has given so far.
    """

    def __init__(self, settings: SimulationSettings, registry: Registry) -> None:
        self.settings = settings
        self.recorder = SimulatedRecorder()
        self.world = SimulatedWorld(
            registry, bit_rate=settings.bit_rate, end=settings.duration, seed=settings.seed, span=settings.span
        )
        self.vehicle = traffic.build(
            self.world,
            traffic.VehicleRequest(settings.flight, settings.escs, settings.rate, settings.stock),
        )
        self.world.context.vehicle = self.vehicle
        for number, order in enumerate(settings.orders):
            self.world.context.take(order, SimulatedWorld.dice(f"fault {number}", settings.seed))
        self.scenario = catalogue.scenario(settings.scenario) if settings.scenario else None
        options = catalogue.story_options(settings.scenario) if settings.scenario else {}
        self.story = RecordedStory(self.world.context, SimulatedWorld.dice("scenario", settings.seed), options)
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
        return tuple(dict.fromkeys(order.text or order.fault.rule for order in self.world.context.unseen))

    @property
    def untold(self) -> tuple[str, ...]:
        """The rules of the scenario that nothing recorded breaks: without them it has not been told."""
        wanted = self.scenario.rules if self.scenario is not None else ()
        return tuple(rule for rule in wanted if all(rule != answer.rule for answer in self.world.context.answers))

    def frames(
        self, pace: Callable[[Iterator[SimulatedFrame]], Iterable[SimulatedFrame]] = iter
    ) -> Iterator[SimulatedFrame]:
        """Yield every recorded frame in order; times from the start of the simulation.

        `pace` may hold back what is on the bus, and end it: the rest was not recorded.
        """
        yield from self.recorder.record(pace(self.world.run()))

    def key(self) -> Mapping[str, Any]:
        """Return the answer key, ready for JSON."""
        story = None if self.scenario is None else describe_story(self.scenario, self.story, self.settings.start)
        return build_key(self.settings, self.recorder, self.vehicle, self.world.context.answers, story)
