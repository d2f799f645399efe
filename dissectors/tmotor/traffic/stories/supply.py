"""The battery, and what it has to carry."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dissectors.times import MILLISECOND, SECOND
from dissectors.tmotor.traffic.stories.crash import OPTIONS, StoryFlight
from dissectors.traffic import Scenario

if TYPE_CHECKING:
    from dissectors.traffic import Story

# Motors with this much to carry are near their limit from the start.
_HEAVY = 2.4
_LOOK = 20 * MILLISECOND
# Volts that a pack loses a second when a cell gives up, and the most of it.
_FALL, _MOST = 6.0, 9.0


def _heavy_lift(story: Story) -> None:
    """Let the payload be too much: all motors give what they have and obey."""
    flight = StoryFlight(story)
    airframe = flight.vehicle.plan.airframe

    def take() -> None:
        story.tell("the vehicle is too heavy: every motor gives all it has")
        flight.settle("thrust", ("thrust", "none"), within=0.5 * story.world.end / SECOND)
        airframe.load = _HEAVY

    story.world.at(0, take)


def _pack_lost(story: Story) -> None:
    """Let the pack's plug go: all ESCs are gone at once, the autopilot has a supply of its own."""
    flight = StoryFlight(story)

    def fail() -> None:
        story.tell("the pack is gone: all ESCs are without power, the autopilot lives on")
        for esc in flight.vehicle.escs:
            esc.node.silent = True
            esc.operation.fail(esc.motor)
            esc.mode = 6

    # A cable from the ESCs to the others that comes off looks like that.
    flight.fail(fail, "battery", ("bus", "unknown"))


def _two_packs(story: Story) -> None:
    """Let one of two packs give up: half of the ESCs lose their voltage together."""
    flight = StoryFlight(story)
    half = flight.vehicle.escs[story.random.randrange(2) :: 2]

    def fail() -> None:
        story.tell(f"one of two packs fails: channels {', '.join(str(esc.index + 1) for esc in half)} lose voltage")
        begin = story.world.now

        def fall() -> None:
            lost = min(_MOST, _FALL * (story.world.now - begin) / SECOND)
            for esc in half:
                esc.sag = lost
            story.world.at(story.world.now + _LOOK, fall)

        fall()

    flight.fail(fail, "battery", escs=half, within=1.2)


SCENARIOS = (
    Scenario(
        "heavy-lift",
        "the payload is too heavy",
        "Every motor is commanded near to all it has, and all of them obey; the voltage sags as their current "
        "explains. Nothing is broken.",
        _heavy_lift,
        seconds=16.0,
        least=4,
        options=("tail", "distract", "mute"),
    ),
    Scenario(
        "pack-lost",
        "the pack's plug comes off in the air",
        "All ESCs are silent at the same moment and stay so; autopilot and recorder have a supply of their own and "
        "go on, with throttles that nobody hears.",
        _pack_lost,
        seconds=16.0,
        least=4,
        options=OPTIONS,
    ),
    Scenario(
        "two-packs",
        "one of two packs fails",
        "Every second motor is fed by a pack of its own. One of the two loses its voltage within a second or two; the "
        "other half makes up for it.",
        _two_packs,
        seconds=16.0,
        least=4,
        options=OPTIONS,
    ),
)
