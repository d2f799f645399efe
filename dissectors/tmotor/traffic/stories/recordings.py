"""The recording itself: frames that it loses, and its end."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dissectors.times import MILLISECOND, SECOND
from dissectors.tmotor.traffic.flights import hover
from dissectors.tmotor.traffic.stories.crash import OPTIONS, SHOWN, StoryFlight
from dissectors.traffic import Scenario

if TYPE_CHECKING:
    from collections.abc import Callable

    from dissectors.traffic import Story

_LOST, _BETWEEN = (5, 60), (200, 1500)  # ms
# A recorder that has too much to do: it loses this, and gets that in between (ms); for so long (s).
_OVERLOADED, _KEPT, _LOAD = (20, 200), (3, 30), (0.8, 2.0)
# A hole that hides what began (ms), and when it begins before that (ms).
_HOLE, _BEFORE = (400, 800), (50, 250)
# A clock that gets its time from satellites in the air, between these shares of the time.
_STEPPED, _SET = 7213 * SECOND, (0.42, 0.48)
# What ends the recording looks alike, whoever it was.
_CUT = ("unknown", "recorder", "none")
# A little later than this share of the flight at least.
_ENDS = (0.6, 0.8)


def _bad_recorder(story: Story) -> None:
    """Let nothing go wrong but the recorder, which loses frames of everybody again and again."""
    flight = StoryFlight(story, hover(story.world.end / SECOND))
    flight.settle("none", ("none", "recorder"))
    story.world.at(0, lambda: story.tell("a healthy flight, recorded by something that is too slow"))
    story.world.at(2 * SECOND, lambda: _lose(story, story.world.end, _LOST, _BETWEEN))


def _lose(story: Story, until: int, lost: tuple[int, int], kept: tuple[int, int]) -> None:
    """Lose frames of everybody again and again."""
    world, random = story.world, story.random
    if world.now < until:
        end = world.now + random.randrange(*lost) * MILLISECOND
        world.deafen(end)
        world.at(end + random.randrange(*kept) * MILLISECOND, lambda: _lose(story, until, lost, kept))


def _overload(story: Story) -> None:
    flight = StoryFlight(story, hover(story.world.end / SECOND))

    def load() -> None:
        story.tell("the recorder has too much to do and loses frames of everybody")
        flight.settle("recorder", ("recorder", "none"), within=0.3)
        until = story.world.now + round(story.random.uniform(*_LOAD) * SECOND)
        _lose(story, until, _OVERLOADED, _KEPT)

    story.world.at(round(story.world.end * story.random.uniform(0.4, 0.6)), load)


def _lossy_crash(story: Story) -> None:
    flight = StoryFlight(story)

    def lose() -> None:
        flight.turn_over()
        flight.when_away(overload)

    def overload() -> None:
        story.tell("the bus is loaded by the crash, and the recorder loses frames of everybody")
        _lose(story, story.world.end, _OVERLOADED, _KEPT)

    flight.fail(lose, "control", ("recorder", "unknown"), within=SHOWN)


def _blind_crash(story: Story) -> None:
    """Let the recorder miss the moment that matters."""
    flight = StoryFlight(story)
    esc = flight.any_esc()

    def miss() -> None:
        story.tell("the recorder has too much to do and loses frames of everybody")
        hole = story.random.randrange(*_HOLE)
        story.world.deafen(story.world.now + hole * MILLISECOND)
        story.world.at(story.world.now + story.random.randrange(*_BEFORE) * MILLISECOND, fail)

    def fail() -> None:
        story.tell(f"node {esc.node.number} loses its power, which nobody has recorded")
        esc.node.silent = True
        esc.mode = 6

    flight.fail(miss, "wiring", ("recorder", "esc", "unknown"), [esc], within=1.0)


def _clock_crash(story: Story) -> None:
    """Set the recorder's clock in the air, some time before the crash."""
    flight = StoryFlight(story)
    esc = flight.any_esc()
    by = -_STEPPED if story.choose("back", 0.5) else _STEPPED

    def step() -> None:
        story.tell(f"the recorder's clock is set by {by / SECOND:+g} s")
        story.world.step_clock(by)

    def fail() -> None:
        story.tell(f"the motor of node {esc.node.number} is blocked")
        esc.motor.blocked = True

    story.world.at(round(story.world.end * story.random.uniform(*_SET)), step)
    flight.fail(fail, "esc", escs=[esc])


def _power_cut(story: Story) -> None:
    def end() -> None:
        story.tell("vehicle and recorder lose their power in the same moment")
        story.settle("battery", _CUT)
        story.world.stop()

    _ends(story, end)


def _autopilot_dies(story: Story) -> None:
    def end() -> None:
        story.tell("the autopilot, which is the recorder, dies")
        story.settle("device", _CUT, nodes=(story.vehicle.autopilot.number,))
        story.world.stop()

    _ends(story, end)


def _ends(story: Story, end: Callable[[], None]) -> None:
    StoryFlight(story)
    story.world.at(round(story.world.end * story.random.uniform(*_ENDS)), end)


SCENARIOS = (
    Scenario(
        "bad-recorder",
        "a healthy flight, and a recorder that loses frames",
        "Up, stay, down, motors off. The recorder loses some milliseconds of everybody's frames again and again and "
        "does not say so.",
        _bad_recorder,
        seconds=24.0,
        least=2,
        options=("distract", "mute"),
    ),
    Scenario(
        "recorder-overload",
        "a healthy flight, and a recorder that loses most frames for a moment",
        "Up, stay, down, motors off. For a second or two the recorder has too much to do and loses most of everybody's "
        "frames; all transfer IDs jump together.",
        _overload,
        seconds=24.0,
        least=2,
        options=("distract", "mute"),
    ),
    Scenario(
        "lossy-crash",
        "control is lost, and the recorder loses frames from then on",
        "The vehicle turns over with every device healthy. The crash loads the bus, and the recorder loses most of "
        "everybody's frames until the end: what is missing there is no evidence.",
        _lossy_crash,
        seconds=16.0,
        least=4,
        options=("tail", "distract", "mute"),
    ),
    Scenario(
        "blind-crash",
        "the recorder misses the moment in which an ESC loses its power",
        "For half a second nothing is recorded of anybody. An ESC loses its power meanwhile; what the recording shows "
        "is a hole, and a vehicle that falls behind it.",
        _blind_crash,
        seconds=16.0,
        least=4,
        options=("tail", "distract", "mute"),
    ),
    Scenario(
        "clock-crash",
        "the recorder's clock is set shortly before a motor is blocked",
        "The recorder gets its time from a receiver that finds its satellites in the air: all stamps from then on are "
        "two hours and 13 s later, or earlier. Seconds later something blocks a rotor. It is one flight.",
        _clock_crash,
        seconds=16.0,
        least=4,
        options=(*OPTIONS, "back"),
    ),
    Scenario(
        "power-cut",
        "vehicle and recorder lose their power together",
        "In the air everything is without power in one moment, the recorder too. The recording ends in a healthy "
        "flight, as one does whose recorder alone has died.",
        _power_cut,
        seconds=16.0,
        least=4,
        options=("distract", "mute"),
    ),
    Scenario(
        "autopilot-dies",
        "the autopilot dies, and the recording with it",
        "The recorder is a part of the autopilot. When this dies in the air, the recording ends in a healthy flight.",
        _autopilot_dies,
        seconds=16.0,
        least=4,
        options=("distract", "mute"),
    ),
)
