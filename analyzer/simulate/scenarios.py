"""Stories that can happen on any DroneCAN bus; those of a vehicle stand with the vehicle."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.simulate import gps
from dissectors.times import MILLISECOND, SECOND
from dissectors.traffic import Scenario, SimulatedFrame, Step

if TYPE_CHECKING:
    from dissectors.traffic import Case, Sending, Story

# SocketCAN error classes and where they put their details (linux/can/error.h).
_CONTROLLER, _PROTOCOL, _BUS_ERROR, _RESTARTED, _COUNTERS = 0x004, 0x008, 0x080, 0x100, 0x200
_STATE = {96: 0x04, 128: 0x10}  # receive errors that make a controller warn, and error passive
_KINDS = {0x01: "bit", 0x02: "form", 0x04: "stuff"}

# What a receiver finds out about it afterwards.
_AFTERMATH = (
    *("BUS-007", "BUS-017", "BUS-020", "BUS-025", "BUS-028"),
    *("TRF-005", "TRF-006", "TRF-007", "TRF-016"),
    *("TYP-305", "TYP-501", "PUSH-410"),
)

_NOISE, _SILENCE = 150 * MILLISECOND, 1600 * MILLISECOND
_STEPPED = 7213 * SECOND
# Receivers count one error up for each frame that is destroyed, eight if they saw it first (ISO 11898-1).
_STEP = 8


def _bus_break(story: Story) -> None:
    begin = story.world.end // 2
    story.world.at(begin, lambda: _noise(story, begin + _NOISE))


def _noise(story: Story, until: int) -> None:
    """Destroy frames one after the other, until nothing gets through at all."""
    world = story.world
    story.tell("a connector works loose: frames are destroyed on the wire, the recorder's receive errors rise")
    story.settle("bus", within=20 * MILLISECOND)
    noise = story.case("CAN-004", "error frames while the connector works loose", ("BUS-005",))
    errors = 0

    def destroy() -> None:
        nonlocal errors
        if world.now >= until:
            _silence(story)
            return
        errors = min(errors + _STEP, 135)
        frame = _error(errors, story.random.choice(tuple(_KINDS)))
        noise.mark(frame)
        noise.say(f"error frames while the connector works loose, receive errors up to {errors}")
        world.put([frame])
        world.block(world.now + 30_000, keep=True)
        world.at(world.now + story.random.randrange(2, 12) * MILLISECOND, destroy)

    destroy()


def _silence(story: Story) -> None:
    world = story.world
    story.tell(f"the bus is open: nobody gets a frame through for {_SILENCE // MILLISECOND} ms")
    gap = story.case("CAP-002", f"nothing on the bus for {_SILENCE // MILLISECOND} ms", _AFTERMATH)
    world.block(world.now + _SILENCE)
    world.at(world.now + _SILENCE, lambda: _repaired(story, gap))


def _repaired(story: Story, gap: Case) -> None:
    story.tell("contact again: what waited too long was given up, transfer IDs have moved on")
    story.world.block(story.world.now)
    frame = SimulatedFrame(_RESTARTED, bytes(8), error=True)
    gap.mark(frame)
    story.world.put([frame])
    gap.touch("frames", lambda _, sending: _found(gap, sending))


def _found(gap: Case, sending: Sending) -> Step:
    gap.mark(sending.frames[0])
    return Step.DONE


def _error(errors: int, kind: int) -> SimulatedFrame:
    """Return a receiver controller's report: the kind of error, its counter, and the state that this brings."""
    state = _STATE.get(errors, 0)
    number = _PROTOCOL | _BUS_ERROR | _COUNTERS | (_CONTROLLER if state else 0)
    return SimulatedFrame(number, bytes((0, state, kind, 0, 0, 0, 0, errors)), error=True)


def _recording_ends(story: Story) -> None:
    story.world.at(story.world.end * 7 // 10, lambda: _watch_the_end(story))


def _watch_the_end(story: Story) -> None:
    end = story.case("TRF-008", "the recording ends inside this transfer")

    def last(case: Case, sending: Sending) -> Step:
        if len(sending.frames) < 3:
            return Step.SKIP
        story.tell("the recorder loses power in the middle of a transfer, the motors still turning")
        kept = sending.frames[:-1]
        for frame in kept:
            case.mark(frame)
        case.say(f"the recording ends behind frame {len(kept)} of {len(sending.frames)} of this transfer")
        story.settle("recorder", ("recorder", "none", "unknown"))
        story.world.cut(kept[-1])
        return Step.DONE

    end.touch("frames", last)


def _clock_step(story: Story) -> None:
    world, random = story.world, story.random
    by = -_STEPPED if story.choose("back", 0.5) else _STEPPED

    def settle() -> None:
        story.tell("a healthy flight")
        story.settle("none")

    def step() -> None:
        story.tell(f"the recorder's clock is set by {by / SECOND:+g} s")
        world.step_clock(by)

    world.at(0, settle)
    world.at(round(world.end * random.uniform(0.2, 0.4)), step)


SCENARIOS = (
    Scenario(
        "bus-break",
        "the bus breaks: error frames, then silence",
        "In flight a connector works loose. For 150 ms frames are destroyed and sent again, the recorder's controller "
        "counts receive errors up to error passive. Then the bus is open for 1.6 s: no command reaches an ESC, motors "
        "run down, nothing is recorded. When contact returns, everybody goes on where it is by then.",
        _bus_break,
        rules=("CAN-004", "CAP-002"),
    ),
    Scenario(
        "recording-ends",
        "the recording just ends",
        "The recorder loses power at 70 % of the planned time, in the middle of a transfer and of the flight: no "
        "landing, no shutdown, no error. What is there until then is a healthy flight.",
        _recording_ends,
        rules=("TRF-008",),
    ),
    Scenario(
        "clock-step",
        "the recorder's clock is set in flight",
        "The recorder gets its time from a GPS receiver that finds its satellites only in flight. All stamps from then "
        "on are two hours and 13 s later, or earlier; the flight itself is one, and healthy.",
        _clock_step,
        seconds=24.0,
        options=("back",),
    ),
    gps.SCENARIO,
)
