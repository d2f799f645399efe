"""One node's wire or power: what it is asked and what it says get lost."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dissectors.times import MILLISECOND
from dissectors.tmotor.traffic.stories.crash import OPTIONS, StoryFlight
from dissectors.traffic import Scenario

if TYPE_CHECKING:
    from dissectors.traffic import Story

# Milliseconds without contact, and with it.
_HOLE, _CONTACT = (60, 160), (100, 900)


def _esc_power(story: Story) -> None:
    flight = StoryFlight(story)
    esc = flight.any_esc()

    def fail() -> None:
        story.tell(f"node {esc.node.number} loses its power")
        esc.node.silent = True
        esc.mode = 6
        esc.operation.fail(esc.motor)

    flight.fail(fail, "wiring", ("esc", "unknown"), [esc])


def _esc_wire(story: Story) -> None:
    """Let one ESC's plug shake: it neither hears nor is heard for moments."""
    flight = StoryFlight(story)
    esc = flight.any_esc()

    def fail() -> None:
        story.tell(f"the CAN plug of node {esc.node.number} shakes loose")
        shake()

    def shake() -> None:
        node, world = esc.node, story.world
        node.cut = not node.cut
        span = story.random.randrange(*(_HOLE if node.cut else _CONTACT)) * MILLISECOND
        world.at(world.now + span, shake)

    flight.fail(fail, "wiring", escs=[esc], within=1.0)


def _deaf_esc(story: Story) -> None:
    flight = StoryFlight(story)
    esc = flight.any_esc()

    def fail() -> None:
        story.tell(f"node {esc.node.number} hears no throttle any more, though the bus carries it")
        esc.deaf = True

    # Without a bit for it a motor just stops, whatever the reason.
    flight.fail(fail, "wiring", ("esc", "unknown") if esc.stock or flight.mute else ("esc",), [esc])


def _esc_brown_out(story: Story) -> None:
    flight = StoryFlight(story)
    esc = flight.any_esc()

    def fail() -> None:
        story.tell(f"node {esc.node.number} restarts in flight")
        esc.restart()

    flight.fail(fail, "wiring", ("esc", "unknown"), [esc])


SCENARIOS = (
    Scenario(
        "esc-power",
        "an ESC loses its power in the air",
        "The supply wire of one ESC breaks: in the middle of a flight it is silent, and its motor runs out. The "
        "others take over what they can. From the bus it looks like a broken transmitter.",
        _esc_power,
        seconds=16.0,
        least=4,
        options=OPTIONS,
    ),
    Scenario(
        "esc-wire",
        "the CAN plug of an ESC shakes",
        "One ESC has no contact for some 100 ms again and again. Its transfer IDs jump, its uptime runs on, nobody "
        "else loses anything; where the hole is longer than its timeout it lets the motor run down for a moment.",
        _esc_wire,
        seconds=16.0,
        least=4,
        options=OPTIONS,
    ),
    Scenario(
        "deaf-esc",
        "an ESC gets no throttle though the bus carries it",
        "The receiver of one ESC fails: it reports throttle loss and stops its motor, while RawCommand is there at "
        "400 Hz for everybody else.",
        _deaf_esc,
        seconds=16.0,
        least=4,
        options=OPTIONS,
    ),
    Scenario(
        "esc-brown-out",
        "an ESC restarts in the air",
        "One ESC loses its supply for a moment and starts anew: its uptime, its counters and its transfer IDs begin "
        "at zero, and its motor has stopped meanwhile.",
        _esc_brown_out,
        seconds=16.0,
        least=4,
        options=OPTIONS,
    ),
)
