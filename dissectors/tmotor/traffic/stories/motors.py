"""One motor, its propeller or its ESC fails in the air."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dissectors.times import MILLISECOND, SECOND
from dissectors.tmotor.traffic.flights import cruise, hover, later
from dissectors.tmotor.traffic.stories.crash import OPTIONS, StoryFlight
from dissectors.traffic import Scenario

if TYPE_CHECKING:
    from dissectors.traffic import Story

# Seconds of a flight before the one that matters.
_FIRST = 21.0
# Shares of torque and thrust: a motor without its propeller, and one whose blades are chipped.
_BARE, _CHIPPED = (0.02, 0.0), (0.62, 0.6)
# The rotor's inertia is mostly that of its propeller.
_BARE_INERTIA = 0.1
# ESCs that speak T-Motor's protocol say so if a rotor stands; one out of step does not know that it does.
_STALL = 1 << 7
# A rotor out of step is held and let go again every few milliseconds.
_HELD, _FREE = (10, 30), (10, 25)
# An ESC that gets too hot gives so much of its duty cycle. It is this warm (degC) by then, for so much heat (W).
_DERATED, _WARM, _HEAT = 0.36, (84.0, 92.0), 24.0


def _propeller_lost(story: Story) -> None:
    flight = StoryFlight(story)
    esc = flight.any_esc()

    def fail() -> None:
        story.tell(f"the motor of node {esc.node.number} loses its propeller")
        lose_propeller(esc.motor)

    flight.fail(fail, "propulsion", escs=[esc])


def lose_propeller(motor: Any) -> None:
    """Leave a motor without its propeller."""
    motor.load, motor.lift = _BARE
    motor.inertia = _BARE_INERTIA


def _blade_damage(story: Story) -> None:
    flight = StoryFlight(story)
    esc = flight.any_esc()

    def fail() -> None:
        story.tell(f"the propeller of node {esc.node.number} loses the tips of its blades")
        esc.motor.load, esc.motor.lift = _CHIPPED

    flight.fail(fail, "propulsion", escs=[esc], within=0.5)


def _stall(story: Story) -> None:
    flight = StoryFlight(story)
    esc = flight.any_esc()

    def fail() -> None:
        story.tell(f"the motor of node {esc.node.number} is blocked")
        esc.motor.blocked = True

    flight.fail(fail, "esc", escs=[esc])


def _second_flight(story: Story) -> None:
    """Let a flight be well that is none of this crash's business."""
    legs = [*hover(_FIRST), *later(cruise(story.world.end / SECOND - _FIRST), _FIRST)]
    flight = StoryFlight(story, legs, begin=_FIRST)
    esc = flight.any_esc()

    def fail() -> None:
        story.tell(f"the motor of node {esc.node.number} is blocked, in the second flight")
        esc.motor.blocked = True

    flight.fail(fail, "esc", escs=[esc])


def _desync(story: Story) -> None:
    flight = StoryFlight(story)
    esc = flight.any_esc()
    recovers = story.choose("recovers", 0.5)

    def fail() -> None:
        esc.hidden |= _STALL
        until = story.world.now + (300 * MILLISECOND if recovers else story.world.end)
        story.tell(f"the motor of node {esc.node.number} gets out of step{' for 0.3 s' if recovers else ''}")
        _slip(story, esc, until)

    # Few reports may miss what lasts so short.
    flight.fail(fail, "esc", ("control", "unknown") if recovers and flight.slow else (), [esc])


def _slip(story: Story, esc: Any, until: int) -> None:
    """Hold the rotor and let it go, again and again."""
    world, motor = story.world, esc.motor
    motor.blocked = not motor.blocked and world.now < until
    if world.now < until:
        span = story.random.randrange(*(_HELD if motor.blocked else _FREE)) * MILLISECOND
        world.at(world.now + span, lambda: _slip(story, esc, until))


def _derating(story: Story) -> None:
    flight = StoryFlight(story)
    esc = flight.any_esc()
    esc.motor.temperature, esc.heat = story.random.uniform(*_WARM), _HEAT

    def fail() -> None:
        story.tell(f"node {esc.node.number} limits itself to {_DERATED:.0%} and tells nobody")
        esc.limit = _DERATED

    flight.fail(fail, "esc", escs=[esc], within=0.5)


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
        "blade-damage",
        "a propeller loses the tips of its blades",
        "The tips of one propeller break off. At the same command its motor turns as fast as before, at much less "
        "current, and gives less thrust; the autopilot commands it up and the vehicle flies on.",
        _blade_damage,
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
        "second-flight",
        "a motor is blocked in the second of two flights",
        "A flight that lands with nothing wrong; some seconds later the same vehicle takes off again, and in the air "
        "something blocks a rotor.",
        _second_flight,
        seconds=37.0,
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
