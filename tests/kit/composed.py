"""Flights that go wrong in ways no scenario of the simulator has: tests say what happens to which motors, and when."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from analyzer.simulate.story import RecordedStory
from analyzer.simulate.world import SimulatedWorld
from dissectors.times import SECOND
from dissectors.tmotor.traffic.stories.crash import StoryFlight
from kit.simulated import simulation, text_of

if TYPE_CHECKING:
    from collections.abc import Callable

    Happen = Callable[[StoryFlight], None]

CALM = dict.fromkeys(("twin", "distract", "mute"), False) | {"tail": True}


def composed(
    *happenings: tuple[float, Happen], seed: int = 1, seconds: float = 16, fly: Happen = lambda _: None,
    flight: Callable[[Any], StoryFlight] = StoryFlight, **settings: Any,
) -> str:  # fmt: skip
    """The candump text of a flight in which things happen at their times (s); `fly` prepares it."""
    run = simulation(seconds, seed=seed, **({"escs": 4, "rate": 30} | settings))
    story = RecordedStory(run.world.context, SimulatedWorld.dice("scenario", seed), CALM)
    flown = flight(story)
    fly(flown)
    for at, happen in happenings:
        run.world.at(round(at * SECOND), lambda happen=happen: happen(flown))  # type: ignore[misc]
    return text_of(run, run.frames())


def restart(*indexes: int) -> Happen:
    """Let ESCs lose their power for a moment."""

    def happen(flight: StoryFlight) -> None:
        for index in indexes:
            flight.vehicle.escs[index].restart()

    return happen


def power_off(*indexes: int) -> Happen:
    """Let ESCs lose their power for good."""

    def happen(flight: StoryFlight) -> None:
        for index in indexes:
            esc = flight.vehicle.escs[index]
            esc.node.silent, esc.mode = True, 6
            esc.operation.fail(esc.motor)

    return happen


def stall(*indexes: int) -> Happen:
    """Let motors be blocked."""

    def happen(flight: StoryFlight) -> None:
        for index in indexes:
            flight.vehicle.escs[index].motor.blocked = True

    return happen


def throw(*indexes: int) -> Happen:
    """Let motors lose their propellers."""

    def happen(flight: StoryFlight) -> None:
        for index in indexes:
            motor = flight.vehicle.escs[index].motor
            motor.load, motor.lift, motor.inertia = 0.02, 0.0, 0.1

    return happen


def deafen(seconds: float) -> Happen:
    """Let the recorder lose everything for so long."""

    def happen(flight: StoryFlight) -> None:
        flight.world.deafen(flight.world.now + round(seconds * SECOND))

    return happen
