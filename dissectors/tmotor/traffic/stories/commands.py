"""The autopilot, and what it wants: control that is lost, commands that end or are zero."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dissectors.times import MILLISECOND
from dissectors.tmotor.traffic.stories.crash import OPTIONS, SHOWN, StoryFlight
from dissectors.traffic import Scenario

if TYPE_CHECKING:
    from dissectors.traffic import Story

_CHECKED = (900, 1600)  # ms that a crash check waits for
_AWAY = (1500, 4000)  # ms that an autopilot takes to start


def _control_lost(story: Story) -> None:
    StoryFlight(story).lose_control()


def _autopilot_reboot(story: Story) -> None:
    flight = StoryFlight(story)
    vehicle, world = flight.vehicle, story.world

    def fail() -> None:
        story.tell("the autopilot restarts in flight: no commands, no NodeStatus")
        vehicle.commanding = False
        vehicle.autopilot.silent = True
        world.at(world.now + story.random.randrange(*_AWAY) * MILLISECOND, back)

    def back() -> None:
        story.tell("the autopilot is back and commands zero")
        vehicle.autopilot.restart()
        vehicle.autopilot.silent = False
        vehicle.plan.disarm()
        vehicle.commanding = True

    flight.fail(fail, "commands-lost", ("device",), within=0.05)


def _zero_in_air(story: Story) -> None:
    flight = StoryFlight(story)

    def fail() -> None:
        story.tell("somebody disarms in the air: zero throttle for all")
        flight.vehicle.plan.disarm()

    flight.fail(fail, "commanded", within=0.05)


def _crash_check(story: Story) -> None:
    flight = StoryFlight(story)

    def check() -> None:
        story.tell("crash check: the autopilot disarms in the air")
        flight.vehicle.plan.disarm()

    def lose() -> None:
        flight.turn_over()
        flight.when_away(
            lambda: story.world.at(story.world.now + story.random.randrange(*_CHECKED) * MILLISECOND, check)
        )

    flight.fail(lose, "control", within=SHOWN)


SCENARIOS = (
    Scenario(
        "control-lost",
        "control is lost, with every device healthy",
        "The vehicle turns over in the air, because its filter diverges or because of something that is not on the "
        "bus. The commands spread and saturate, every ESC obeys to the end.",
        _control_lost,
        seconds=16.0,
        least=4,
        options=("tail", "distract", "mute"),
    ),
    Scenario(
        "autopilot-reboot",
        "the autopilot restarts in the air",
        "RawCommand and the autopilot's NodeStatus end together. After some seconds it is back, with an uptime of "
        "zero and zero throttle. The ESCs stop after their timeout.",
        _autopilot_reboot,
        seconds=16.0,
        least=4,
        options=OPTIONS,
    ),
    Scenario(
        "zero-in-air",
        "somebody disarms in the air",
        "Every channel is commanded to zero while the vehicle flies, at 400 Hz as before. Who decided that is not on "
        "the bus.",
        _zero_in_air,
        seconds=16.0,
        least=4,
        options=OPTIONS,
    ),
    Scenario(
        "crash-check",
        "the autopilot disarms a vehicle that turns over",
        "Control is lost in the air, with every device healthy; the autopilot's crash check sees that and commands "
        "zero while the motors turn and the vehicle falls. The zero is a consequence.",
        _crash_check,
        seconds=16.0,
        least=4,
        options=("tail", "distract", "mute"),
    ),
)
