"""One node's wire, power or address: what it is asked and what it says get lost."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dissectors.times import MILLISECOND
from dissectors.tmotor.traffic.stories.crash import OPTIONS, CrashFlight
from dissectors.traffic import Scenario

if TYPE_CHECKING:
    from dissectors.traffic import Story

# Milliseconds without contact, and with it.
_HOLE, _CONTACT = (60, 160), (100, 900)


def _esc_power(story: Story) -> None:
    flight = CrashFlight(story)
    esc = flight.any_esc()

    def fail() -> None:
        story.tell(f"node {esc.node.number} loses its power")
        esc.node.silent = True
        esc.mode = 6
        esc.operation.fail(esc.motor)

    flight.fail(fail, "wiring", ("esc", "unknown"), esc)


def _esc_wire(story: Story) -> None:
    """Let one ESC's plug shake: it neither hears nor is heard for moments."""
    flight = CrashFlight(story)
    esc = flight.any_esc()

    def fail() -> None:
        story.tell(f"the CAN plug of node {esc.node.number} shakes loose")
        shake()

    def shake() -> None:
        node, world = esc.node, story.world
        node.cut = not node.cut
        span = story.random.randrange(*(_HOLE if node.cut else _CONTACT)) * MILLISECOND
        world.at(world.now + span, shake)

    flight.fail(fail, "wiring", ("unknown",), esc)


def _deaf_esc(story: Story) -> None:
    flight = CrashFlight(story)
    esc = flight.any_esc()

    def fail() -> None:
        story.tell(f"node {esc.node.number} hears no throttle any more, though the bus carries it")
        esc.deaf = True

    flight.fail(fail, "wiring", ("esc",), esc)


def _esc_brown_out(story: Story) -> None:
    flight = CrashFlight(story)
    esc = flight.any_esc()

    def fail() -> None:
        story.tell(f"node {esc.node.number} restarts in flight")
        esc.restart()

    flight.fail(fail, "wiring", ("esc", "unknown"), esc)


def _duplicate_index(story: Story) -> None:
    """Give two ESCs one index: both follow the same channel, and nobody follows the other."""
    flight = CrashFlight(story)
    first, second = flight.vehicle.escs[:2]

    def take() -> None:
        story.tell(f"the ESC of node {second.node.number} was exchanged and has index {first.index} as well")
        story.settle("address", ("setup",), node=second.node.number, channel=first.index + 1)
        second.index = first.index

    story.world.at(0, take)


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
    Scenario(
        "duplicate-index",
        "two ESCs have one index",
        "An ESC was exchanged and never given its own index. It follows the channel of its neighbour and reports as "
        "that; one channel has nobody, and the vehicle flies as well as it can.",
        _duplicate_index,
        seconds=12.0,
        least=4,
        options=("tail", "distract"),
    ),
)
