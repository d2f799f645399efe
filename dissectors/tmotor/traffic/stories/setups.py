"""ESCs that were exchanged: rightly, with the wrong direction, or with an index that another one has."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dissectors.times import MILLISECOND, SECOND
from dissectors.tmotor.traffic.esc import unique_ids
from dissectors.tmotor.traffic.flights import Leg, hover, later
from dissectors.tmotor.traffic.stories.crash import StoryFlight
from dissectors.traffic import Scenario

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from dissectors.traffic import Story

_WRONG = (1.0, -0.7)  # torque and thrust of a propeller that turns the wrong way
# The first of two flights takes so many seconds; then nobody has power for some time (ms).
_FIRST, _DARK = 21.0, (1500, 2500)
# The second one stands for so long, and is in the air after another second.
_STANDS = 7.0


def _swapped(story: Story) -> None:
    """Let a motor turn the wrong way from the start, as one that was exchanged and never set."""
    flight = StoryFlight(story)
    esc = flight.any_esc()

    def take() -> None:
        story.tell(f"the ESC of node {esc.node.number} was exchanged and turns the wrong way")
        _settle_setup(flight, esc)
        _turn_round(esc)

    story.world.at(0, take)


def _settle_setup(flight: StoryFlight, esc: Any) -> None:
    """Tell that it is set up wrongly; whoever does not know its direction sees that control is lost at take-off."""
    flight.settle("setup", ("setup", "control", "unknown"), [esc], within=flight.world.end / SECOND / 2)


def _turn_round(esc: Any) -> None:
    esc.motor.mount = -esc.motor.mount
    esc.motor.load, esc.motor.lift = _WRONG


def _duplicate_index(story: Story) -> None:
    """Give two ESCs one index: both follow the same channel, and nobody follows the other."""
    flight = StoryFlight(story)
    first, second = flight.vehicle.escs[:2]

    def take() -> None:
        story.tell(f"the ESC of node {second.node.number} was exchanged and has index {first.index} as well")
        second.index = first.index
        flight.settle("address", ("address", "setup"), (first, second), within=0.5)

    story.world.at(0, take)


def _swap_flights(story: Story) -> None:
    flight, esc = _two_flights(story)

    def change() -> None:
        story.tell(f"the ESC of node {esc.node.number} is exchanged between two flights and turns the wrong way")
        _settle_setup(flight, esc)
        _exchange(story, esc)
        _turn_round(esc)

    _power_off(flight, change)


def _exchanged_esc(story: Story) -> None:
    flight, esc = _two_flights(story, landing=True)
    flight.settle("none", ("none",))

    def change() -> None:
        story.tell(f"the ESC of node {esc.node.number} is exchanged between two flights, and set rightly")
        _exchange(story, esc)

    _power_off(flight, change)


def _two_flights(story: Story, *, landing: bool = False) -> tuple[StoryFlight, Any]:
    """Return a flight of two parts, and the ESC that changes between them."""
    seconds = story.world.end / SECOND
    second = _FIRST + _STANDS
    legs = [*hover(_FIRST), Leg(second, "idle"), Leg(second + 1, "fly", 2.0)]
    if landing:
        legs += later(hover(_FIRST)[-3:], seconds - _FIRST)
    flight = StoryFlight(story, legs)
    return flight, flight.any_esc()


def _power_off(flight: StoryFlight, then: Callable[[], None]) -> None:
    """Take everybody's power between the flights; meanwhile somebody works on the vehicle."""
    story, world, vehicle = flight.story, flight.world, flight.vehicle
    nodes = [vehicle.autopilot, vehicle.ground, *(esc.node for esc in vehicle.escs)]

    def off() -> None:
        story.tell("power off")
        vehicle.commanding = False
        for node in nodes:
            node.silent = True
        then()
        world.at(world.now + story.random.randrange(*_DARK) * MILLISECOND, on)

    def on() -> None:
        story.tell("power on")
        for esc in vehicle.escs:
            esc.restart()
        for node in nodes[:2]:
            node.restart()
            node.silent = False
        vehicle.commanding = True
        world.at(world.now + SECOND, lambda: _ask(flight, nodes[2:]))

    world.at(round((_FIRST + 0.5) * SECOND), off)


def _ask(flight: StoryFlight, nodes: Iterable[Any]) -> None:
    """Let everybody be asked who he is and how he is set, as after every start."""
    if not flight.vehicle.request.stock:
        flight.vehicle.query()
    for node in nodes:
        flight.vehicle.autopilot.send("uavcan.protocol.GetNodeInfo.Request", {}, dst=node.number)


def _exchange(story: Story, esc: Any) -> None:
    """Put another ESC in the place of one."""
    random = story.random
    (esc.uuid,) = unique_ids(random, 1)
    esc.parameters |= {"esc_uuid": esc.uuid, "esc_startup_times": random.randrange(2, 20)}
    esc.power_on_count = esc.parameters["esc_startup_times"]
    esc.node.unique_id = random.randbytes(16)


SCENARIOS = (
    Scenario(
        "swapped-esc",
        "a motor turns the wrong way after an exchange",
        "An ESC was exchanged, and its motor turns against its propeller. The vehicle tips over as soon as it is in "
        "the air, with every ESC healthy and obeying.",
        _swapped,
        seconds=12.0,
        least=4,
        options=("tail", "distract", "mute"),
    ),
    Scenario(
        "swap-flights",
        "two flights, and a motor that turns the wrong way in the second",
        "A flight that lands; the power is off while an ESC is exchanged. In the second flight its motor turns against "
        "its propeller, and the vehicle tips over at take-off: another unique ID and another sign of the speed.",
        _swap_flights,
        seconds=32.0,
        least=4,
        options=("tail", "distract", "mute"),
    ),
    Scenario(
        "exchanged-esc",
        "two healthy flights with an ESC exchanged between them",
        "A flight that lands; the power is off while an ESC is exchanged for another one with the same node ID and the "
        "same index. The second flight lands, too. Nothing is wrong.",
        _exchanged_esc,
        seconds=44.0,
        least=4,
        options=("distract", "mute"),
    ),
    Scenario(
        "duplicate-index",
        "two ESCs have one index",
        "An ESC was exchanged and never given its own index. It follows the channel of its neighbour and reports as "
        "that; one channel has nobody, and the vehicle flies as well as it can.",
        _duplicate_index,
        seconds=12.0,
        least=4,
        options=("tail", "distract", "mute"),
    ),
)
