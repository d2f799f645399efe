"""Faults of the recorder: clocks that jump, silence, lines cut in two, frames that it had no room for."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.simulate.faults.helpers import nanoseconds, number
from dissectors.times import MILLISECOND, SECOND
from dissectors.traffic import Fault, SimulatedFrame, Step

if TYPE_CHECKING:
    from collections.abc import Callable

    from dissectors.traffic import Case, Sending

_OVERFLOW = bytes((0, 1, 0, 0, 0, 0, 0, 0))
_CONTROLLER = 0x04
# With one ESC too few senders have something to say all the time.
_FEWEST = 2


def _backward(case: Case, sending: Sending) -> Step:
    back = nanoseconds(case, "back")
    sending.frames[-1].shift = back
    case.mark(sending.frames[-1])
    case.say(f"a frame is stamped {back / MILLISECOND:g} ms too early")
    return Step.DONE


def _behind(case: Case, do: Callable[[], None]) -> None:
    """Do it once the next transfer is on the bus, whose last frame the answer names first."""

    def take(case: Case, sending: Sending) -> Step:
        last = sending.frames[-1]
        case.mark(last)

        def wait() -> None:
            if last.t < 0:
                case.world.at(case.world.now + MILLISECOND, wait)
            else:
                do()

        wait()
        return Step.DONE

    case.touch("frames", take)


def _silence(case: Case) -> None:
    """Stop the bus from a frame on; nobody has anything left to say about the time before."""
    world, span = case.world, nanoseconds(case, "seconds")
    until = 0

    def stop() -> None:
        nonlocal until
        until = world.now + span
        world.block(until)
        case.touch("frames", hold)

    def hold(_: Case, sending: Sending) -> Step:
        if sending.t < until:
            for frame in sending.frames:
                frame.lost = True
            return Step.MORE
        case.mark(sending)
        return Step.DONE

    case.say(f"nothing is recorded for {float(case.options['seconds']):g} s")
    _behind(case, stop)


def _deafness(case: Case) -> None:
    """Let the recorder lose every frame for a while, in the middle of transfers, and say nothing."""
    world, span = case.world, nanoseconds(case, "seconds")
    until = 0

    def begin() -> None:
        nonlocal until
        until = world.now + span
        world.deafen(until)
        case.touch("frames", first)

    def first(case: Case, sending: Sending) -> Step:
        if sending.t < until:
            return Step.MORE
        case.mark(sending)
        return Step.DONE

    if len(case.vehicle.escs) < _FEWEST:
        return
    case.say(f"the recorder loses all frames for {float(case.options['seconds']):g} s")
    _behind(case, begin)


def _cut(case: Case, sending: Sending) -> Step:
    sending.frames[0].garbled = True
    case.mark(sending.frames[0])
    case.say("a line of the capture is cut in two")
    return Step.DONE


def _lose(case: Case, sending: Sending) -> Step:
    """Lose some frames as a receive buffer that is too small does, and let the controller say so."""
    lost = number(case, "lost")
    for frame in sending.frames:
        frame.lost = True
    gone = case.state["gone"] = case.state.get("gone", 0) + len(sending.frames)
    if gone < lost:
        return Step.MORE
    error = SimulatedFrame(_CONTROLLER, _OVERFLOW, error=True)
    case.mark(error)
    case.world.put([error])
    case.say(f"the recorder's receive buffer ran over, {gone} frames are lost")
    return Step.DONE


FAULTS: tuple[Fault, ...] = (
    Fault(
        "CAP-001",
        "a time stamp goes backward",
        frames=_backward,
        options={"back": 0.25},
        limits={"back": (0.01, 60)},
        harmless=True,
        exact=True,
        also=("CAP-002", "BUS-007", "BUS-017", "BUS-025"),
    ),
    Fault(
        "CAP-002",
        "nothing is recorded for a while",
        start=_silence,
        options={"seconds": 1.5},
        limits={"seconds": (1.1, 3600)},
        lasts=1800 * MILLISECOND,
        also=(
            "TRF-016",
            "TRF-019",
            "TYP-305",
            "TYP-501",
            "PUSH-009",
            "PUSH-410",
            "BUS-007",
            "BUS-017",
            "BUS-020",
            "BUS-025",
        ),
    ),
    Fault(
        "CAP-003",
        "a line of the capture is cut in two",
        frames=_cut,
        fits=lambda sending: len(sending.frames) == 1,
        harmless=True,
        exact=True,
        also=("TRF-016",),
    ),
    Fault(
        "CAP-004",
        "the recorder has no room for some frames, and says so",
        frames=_lose,
        options={"lost": 4},
        limits={"lost": (1, 100)},
        lasts=SECOND,
        exact=True,
        also=("CAN-004", "TRF-016", "TYP-501", "PUSH-009"),
    ),
    Fault(
        "CAP-006",
        "the recorder loses frames of everybody and does not say so",
        start=_deafness,
        options={"seconds": 0.3},
        limits={"seconds": (0.1, 0.9)},
        lasts=SECOND,
    ),
)
