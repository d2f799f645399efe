"""Flights in which nothing is wrong with any device, however odd they look, and one in which something is beside."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dissectors.records import replace
from dissectors.times import MICROSECOND, MILLISECOND, SECOND
from dissectors.tmotor.traffic.flights import hover
from dissectors.tmotor.traffic.physics.airframe import arms
from dissectors.tmotor.traffic.stories.crash import OPTIONS, StoryFlight
from dissectors.tmotor.traffic.stories.impact import tear
from dissectors.tmotor.traffic.stories.motors import lose_propeller
from dissectors.traffic import Scenario, SimulatedFrame

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dissectors.tmotor.traffic.flights import Leg
    from dissectors.traffic import Story

# Lower motors work in the wind of the upper ones: more torque, less thrust.
_LOWER = (1.12, 0.88)
# A battery too far aft turns the nose up (rad/s2), against which the pilot trims this share of the throttle.
_AFT, _TRIM = 6.3, 0.06
# Volts between two packs that were not charged alike.
_UNEVEN = (0.4, 0.9)
# The last motor stops so long before the end of a flight that lands (s), and the pack goes so long before it.
_UNPLUGGED = 1.0
# Branches stop rotors one after the other (ms), and turn the vehicle (rad/s2).
_BRANCHES, _TWIST = (5, 40), 60.0
# The second interface stamps so much later.
_LATER = 40 * MICROSECOND


def _calm(story: Story, geometry: Sequence[tuple[float, float, float]] | None = None) -> StoryFlight:
    """Return a flight that lands, and say that nothing is wrong with it."""
    flight = StoryFlight(story, hover(story.world.end / SECOND), geometry)
    flight.settle("none", ("none",))
    return flight


def _landing(story: Story) -> None:
    _calm(story)
    story.world.at(0, lambda: story.tell("a flight like any other, which lands"))


def _coaxial(story: Story) -> None:
    _two_layers(story, hover(story.world.end / SECOND)).settle("none", ("none",))
    story.world.at(0, lambda: story.tell("the lower motors work in the wind of the upper ones"))


def _coaxial_failure(story: Story) -> None:
    flight = _two_layers(story)
    esc = flight.any_esc()

    def fail() -> None:
        story.tell(f"the motor of node {esc.node.number} loses its propeller")
        lose_propeller(esc.motor)

    flight.fail(fail, "propulsion", escs=[esc])


def _two_layers(story: Story, legs: Sequence[Leg] | None = None) -> StoryFlight:
    """Put the second half of the motors below the first one, on the same arms, turning the other way."""
    count = len(story.vehicle.escs)
    upper = arms((count + 1) // 2)
    geometry = [*upper, *((roll, pitch, -yaw) for roll, pitch, yaw in upper)][:count]
    flight = StoryFlight(story, legs, geometry)
    for esc in flight.vehicle.escs[len(upper) :]:
        esc.motor.load *= _LOWER[0]
        esc.motor.lift *= _LOWER[1]
    return flight


def _aft_weight(story: Story) -> None:
    flight = _calm(story)
    story.world.at(0, lambda: story.tell("the battery sits too far aft: the rear motors always work harder"))
    flight.attitude.disturbance = (0.0, -_AFT, 0.0)
    flight.attitude.trim = (0.0, _TRIM, 0.0)


def _uneven_packs(story: Story) -> None:
    flight = _calm(story)
    lower = story.random.uniform(*_UNEVEN)
    half = flight.vehicle.escs[story.random.randrange(2) :: 2]
    story.world.at(0, lambda: story.tell(f"of two packs one has {lower:.1f} V less from the start"))
    for esc in half:
        esc.sag = lower


def _unplugged(story: Story) -> None:
    flight = _calm(story)

    def unplug() -> None:
        story.tell("the pack is unplugged after landing; autopilot and recorder go on by USB")
        for esc in flight.vehicle.escs:
            esc.node.silent = True

    story.world.at(story.world.end - round(_UNPLUGGED * SECOND), unplug)


def _two_interfaces(story: Story) -> None:
    _calm(story)
    story.world.at(0, lambda: story.tell("two interfaces record one bus"))

    def again(frame: SimulatedFrame) -> SimulatedFrame | None:
        return None if frame.lost else replace(frame, bus=1, t=frame.t + _LATER, answers=(), sending=None)

    story.world.copy(again)


def _tree(story: Story) -> None:
    """Let a vehicle without its pilot come down in a tree: who is to blame for that is not on the bus."""
    flight = StoryFlight(story)
    if flight.tail:
        flight.settle("none", ("none", "control", "unknown"))
    else:  # it is a recording that just ends
        flight.settle("none", ("none", "recorder", "unknown"))
    escs = flight.random.sample(flight.vehicle.escs, max(2, len(flight.vehicle.escs) // 2))

    def hit() -> None:
        story.tell("the pilot's radio was lost; the vehicle comes down in a tree")
        if not flight.tail:
            story.world.stop()
            return
        turn = flight.random.choice((-1, 1)) * _TWIST
        flight.attitude.disturbance = (turn, -turn, 0.0)
        tear(story, 3)
        at = story.world.now
        for esc in escs:
            at += flight.random.randrange(*_BRANCHES) * MILLISECOND
            story.world.at(at, lambda esc=esc: setattr(esc.motor, "blocked", True))  # type: ignore[misc]

    story.world.at(round(story.world.end * flight.random.uniform(0.55, 0.7)), hit)


SCENARIOS = (
    Scenario(
        "landing",
        "a healthy flight that lands",
        "Up, stay, down, motors off. Nothing is wrong.",
        _landing,
        seconds=24.0,
        options=("distract", "mute"),
    ),
    Scenario(
        "coaxial",
        "a healthy vehicle with motors above each other",
        "Half of the motors sit below the others and always draw more current at the same command. That is how it is "
        "built, and nothing is wrong.",
        _coaxial,
        seconds=24.0,
        least=8,
        options=("distract", "mute"),
    ),
    Scenario(
        "coaxial-failure",
        "a propeller is lost where motors sit above each other",
        "The lower motors always draw more current, as they are built. In the air one motor throws its propeller; that "
        "one is the odd one.",
        _coaxial_failure,
        seconds=16.0,
        least=8,
        options=OPTIONS,
    ),
    Scenario(
        "aft-weight",
        "a healthy vehicle whose battery sits too far aft",
        "The rear motors are commanded more than the front ones from the first moment to the last. Nothing is wrong.",
        _aft_weight,
        seconds=24.0,
        least=4,
        options=("distract", "mute"),
    ),
    Scenario(
        "uneven-packs",
        "a healthy vehicle with two packs",
        "Every second motor is fed by a pack of its own, which had less charge from the start. Nothing is wrong.",
        _uneven_packs,
        seconds=24.0,
        least=4,
        options=("distract", "mute"),
    ),
    Scenario(
        "unplugged",
        "the pack is unplugged after landing",
        "Up, stay, down, motors off. Then somebody unplugs the pack: all ESCs are silent, while autopilot and recorder "
        "go on by USB. Nothing is wrong.",
        _unplugged,
        seconds=25.0,
        least=2,
        options=("distract", "mute"),
    ),
    Scenario(
        "two-interfaces",
        "a healthy flight, recorded twice",
        "Two interfaces record the same bus, so that every node is seen on both. Nothing is wrong.",
        _two_interfaces,
        seconds=24.0,
        options=("distract", "mute"),
    ),
    Scenario(
        "tree",
        "a vehicle without its pilot comes down in a tree",
        "The pilot's radio is lost, which is not on this bus. The vehicle comes down where it should not, with every "
        "device healthy and obeying until branches stop the rotors.",
        _tree,
        seconds=16.0,
        least=4,
        options=("tail", "distract", "mute"),
    ),
)
