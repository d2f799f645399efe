"""The bus that all share fails in the air."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dissectors.times import MILLISECOND
from dissectors.tmotor.traffic.stories.crash import OPTIONS, StoryFlight
from dissectors.traffic import Scenario, SimulatedFrame

if TYPE_CHECKING:
    from dissectors.traffic import Story

# SocketCAN (linux/can/error.h): a bus error with its counters, a controller's state, a controller that is off.
_BUS_ERROR, _CONTROLLER, _OFF, _COUNTERS = 0x088, 0x004, 0x040, 0x200
_WARNING, _PASSIVE = (96, 0x04), (128, 0x10)
_BIT, _STUFF = 0x01, 0x04
# Each frame that is destroyed counts so many errors; then the next one is tried (ms).
_COUNT, _NEXT = 8, (1, 4)


def _bus_fails(story: Story) -> None:
    flight = StoryFlight(story)
    world, random = story.world, story.random

    def fail() -> None:
        story.tell("the cable is crushed: frames are destroyed on the wire, and nobody gets one through any more")
        world.block(world.end)
        destroy(0)

    def destroy(errors: int) -> None:
        errors += _COUNT
        state = next((bit for count, bit in (_PASSIVE, _WARNING) if errors >= count), 0)
        kind = _BUS_ERROR | _COUNTERS | (_CONTROLLER if state else 0)
        data = bytes((0, state, random.choice((_BIT, _STUFF)), 0, 0, 0, 0, min(errors, 135)))
        world.put([SimulatedFrame(kind, data, error=True)])
        if errors < 256:
            world.at(world.now + random.randrange(*_NEXT) * MILLISECOND, lambda: destroy(errors))
        else:
            world.put([SimulatedFrame(_OFF, bytes(8), error=True)])

    flight.fail(fail, "bus", within=0.05)


SCENARIOS = (
    Scenario(
        "bus-fails",
        "the bus fails in the air",
        "The cable that all share is crushed. Frames are destroyed, the recorder's controller counts errors until it "
        "is off the bus, no command reaches an ESC: all motors run down.",
        _bus_fails,
        seconds=16.0,
        least=4,
        options=OPTIONS,
    ),
)
