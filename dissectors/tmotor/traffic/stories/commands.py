"""The autopilot, and what it wants: control that is lost, commands that end, flights in which nothing is wrong."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dissectors.times import MILLISECOND, SECOND
from dissectors.tmotor.traffic.stories.crash import OPTIONS, CrashFlight
from dissectors.traffic import Scenario

if TYPE_CHECKING:
    from dissectors.traffic import Story

_AWAY = (1500, 4000)  # ms that an autopilot takes to start
_WRONG = (1.0, -0.7)  # torque and thrust of a propeller that turns the wrong way
_LOST, _BETWEEN = (5, 60), (200, 1500)  # ms


def _control_lost(story: Story) -> None:
    CrashFlight(story).lose_control()


def _autopilot_reboot(story: Story) -> None:
    flight = CrashFlight(story)
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

    flight.fail(fail, "commands-lost", ("device", "unknown"))


def _zero_in_air(story: Story) -> None:
    flight = CrashFlight(story)

    def fail() -> None:
        story.tell("somebody disarms in the air: zero throttle for all")
        flight.vehicle.plan.disarm()

    flight.fail(fail, "commanded")


def _swapped(story: Story) -> None:
    """Let a motor turn the wrong way from the start, as one that was exchanged and never set."""
    flight = CrashFlight(story)
    esc = flight.any_esc()

    def take() -> None:
        story.tell(f"the ESC of node {esc.node.number} was exchanged and turns the wrong way")
        story.settle("setup", ("control", "unknown"), node=esc.node.number, channel=esc.index + 1)
        esc.motor.mount = -esc.motor.mount
        esc.motor.load, esc.motor.lift = _WRONG

    story.world.at(0, take)


def _landing(story: Story) -> None:
    """Let nothing go wrong at all."""

    def say() -> None:
        story.tell("a flight like any other, which lands")
        story.settle("none", ())

    story.world.at(0, say)


def _bad_recorder(story: Story) -> None:
    """Let nothing go wrong but the recorder, which loses frames of everybody again and again."""
    world, random = story.world, story.random

    def say() -> None:
        story.tell("a healthy flight, recorded by something that is too slow")
        story.settle("none", ("recorder",))

    def lose() -> None:
        world.deafen(world.now + random.randrange(*_LOST) * MILLISECOND)
        world.at(world.now + random.randrange(*_BETWEEN) * MILLISECOND, lose)

    world.at(0, say)
    world.at(2 * SECOND, lose)


SCENARIOS = (
    Scenario(
        "control-lost",
        "control is lost, with every device healthy",
        "The vehicle turns over in the air, because its filter diverges or because of something that is not on the "
        "bus. The commands spread and saturate, every ESC obeys to the end.",
        _control_lost,
        seconds=16.0,
        least=4,
        options=("tail", "distract"),
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
        "swapped-esc",
        "a motor turns the wrong way after an exchange",
        "An ESC was exchanged, and its motor turns against its propeller. The vehicle tips over as soon as it is in "
        "the air, with every ESC healthy and obeying.",
        _swapped,
        seconds=12.0,
        least=4,
        options=("tail", "distract"),
    ),
    Scenario(
        "landing",
        "a healthy flight that lands",
        "Up, stay, down, motors off. Nothing is wrong.",
        _landing,
        seconds=24.0,
    ),
    Scenario(
        "bad-recorder",
        "a healthy flight, and a recorder that loses frames",
        "Up, stay, down, motors off. The recorder loses some milliseconds of everybody's frames again and again and "
        "does not say so.",
        _bad_recorder,
        seconds=24.0,
        least=2,
    ),
)
