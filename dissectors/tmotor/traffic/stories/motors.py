"""One motor, its propeller or its ESC fails in the air."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dissectors.times import MILLISECOND
from dissectors.tmotor.traffic.stories.crash import OPTIONS, CrashFlight
from dissectors.traffic import Scenario

if TYPE_CHECKING:
    from dissectors.traffic import Story

# A motor without its propeller: shares of torque and thrust.
_BARE = (0.02, 0.0)
# ESCs that speak T-Motor's protocol say so if a rotor stands; one out of step does not know that it does.
_STALL = 1 << 7
# A rotor out of step is held and let go again every few milliseconds.
_HELD, _FREE = (10, 30), (10, 25)
# An ESC that gets too hot gives so much of its duty cycle.
_DERATED = 0.36


def _propeller_lost(story: Story) -> None:
    flight = CrashFlight(story)
    esc = flight.any_esc()

    def fail() -> None:
        story.tell(f"the motor of node {esc.node.number} loses its propeller")
        esc.motor.load, esc.motor.lift = _BARE

    flight.fail(fail, "propulsion", ("unknown",), esc)


def _stall(story: Story) -> None:
    flight = CrashFlight(story)
    esc = flight.any_esc()

    def fail() -> None:
        story.tell(f"the motor of node {esc.node.number} is blocked")
        esc.motor.blocked = True

    flight.fail(fail, "esc", ("propulsion",), esc)


def _desync(story: Story) -> None:
    flight = CrashFlight(story)
    esc = flight.any_esc()
    recovers = story.choose("recovers", 0.5)

    def fail() -> None:
        esc.hidden |= _STALL
        until = story.world.now + (300 * MILLISECOND if recovers else story.world.end)
        story.tell(f"the motor of node {esc.node.number} gets out of step{' for 0.3 s' if recovers else ''}")
        _slip(story, esc, until)

    flight.fail(fail, "esc", ("propulsion", "control", "unknown") if recovers else ("propulsion", "unknown"), esc)


def _slip(story: Story, esc: Any, until: int) -> None:
    """Hold the rotor and let it go, again and again."""
    world, motor = story.world, esc.motor
    motor.blocked = not motor.blocked and world.now < until
    if world.now < until:
        span = story.random.randrange(*(_HELD if motor.blocked else _FREE)) * MILLISECOND
        world.at(world.now + span, lambda: _slip(story, esc, until))


def _derating(story: Story) -> None:
    flight = CrashFlight(story)
    esc = flight.any_esc()

    def fail() -> None:
        story.tell(f"node {esc.node.number} limits itself to {_DERATED:.0%} and tells nobody")
        esc.limit = _DERATED
        if not flight.twin:
            esc.heat += 12.0

    flight.fail(fail, "esc", ("propulsion", "unknown"), esc)


SCENARIOS = (
    Scenario(
        "propeller-lost",
        "a motor loses its propeller in the air",
        "One motor throws its propeller. It turns faster than before at less current while its thrust is gone; the "
        "others are commanded up to make up for it, until they saturate and the vehicle tips over, unless it has "
        "motors enough.",
        _propeller_lost,
        seconds=16.0,
        least=4,
        options=OPTIONS,
    ),
    Scenario(
        "motor-stall",
        "a motor is blocked in the air",
        "Something blocks a rotor. Its ESC reports the stall and a large current at no speed, while the others take "
        "over what they can.",
        _stall,
        seconds=16.0,
        least=4,
        options=OPTIONS,
    ),
    Scenario(
        "desync",
        "a motor gets out of step in the air",
        "An ESC loses the position of its rotor: the speed breaks down without a command, the current jumps, and no "
        "bit says so. It may find its rotor again within 0.3 s, which can be enough to lose control.",
        _desync,
        seconds=16.0,
        least=4,
        options=(*OPTIONS, "recovers"),
    ),
    Scenario(
        "derating",
        "an ESC limits itself and does not say so",
        "An ESC gives only a part of the throttle that it is commanded, because it is hot, and sets no bit. The "
        "autopilot commands it higher and higher.",
        _derating,
        seconds=16.0,
        least=4,
        options=OPTIONS,
    ),
)
