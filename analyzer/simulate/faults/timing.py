"""Faults of time and place: pauses inside a transfer, transfers that overtake each other, a second interface."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from analyzer.simulate.faults.helpers import LOG, nanoseconds, same, sender, telemetry, text, transmit, unshown
from dissectors.times import MICROSECOND, MILLISECOND, SECOND
from dissectors.traffic import Fault, SimulatedFrame, Step

if TYPE_CHECKING:
    from dissectors.traffic import Case, Sending

# Two recorders never stamp a frame at the same time.
_LATER = 2 * MICROSECOND
# How long both interfaces have shown the same before one of them misses something.
_BOTH = 300 * MILLISECOND
_BEFORE_THE_END = 400 * MILLISECOND
_NEXT_LINE = 20 * MILLISECOND
# A pause is long; a sender should have given up; a receiver has.
_LONG, _ABORTED, _TIMEOUT = 100 * MILLISECOND, SECOND, 2 * SECOND


def _pause(case: Case) -> None:
    """Pause where no other transfer of the session comes in between, behind a whole one that proves whose it is."""
    node, pause = sender(case), nanoseconds(case, "pause")
    long, rule = pause > _ABORTED, case.answer.rule
    if pause <= (_ABORTED if rule == "TRF-007" else _LONG):
        return
    case.answer.also = ("TRF-027",) if rule == "TRF-007" else ("TRF-007",) if long else ()
    if pause > _TIMEOUT:
        case.answer.also = (*case.answer.also, "TRF-005")

    def shape(sending: Sending) -> None:
        sending.frames[-1].delay = pause
        case.say(f"the last of {len(sending.frames)} frames came {pause / SECOND:g} s after the others")

    transmit(case, node, LOG, text("self-test passed"))
    case.world.at(case.world.now + _NEXT_LINE, lambda: transmit(case, node, LOG, text("warm start, calibrated"), shape))


def _shows(case: Case, sending: Sending) -> bool:
    """Return if a transfer of several frames, of the node that the settings name, is there to be changed."""
    return not sending.changed and telemetry(sending) and case.options.get("node") in (None, sending.node)


def _cut(case: Case) -> None:
    """End the recording inside the next transfer that can show it."""
    world = case.world

    def last(case: Case, sending: Sending) -> Step:
        if not _shows(case, sending):
            return Step.SKIP
        case.mark(sending)
        world.cut(sending.frames[0])
        case.say(f"the recording ends behind the first of {len(sending.frames)} frames")
        return Step.DONE

    case.touch("frames", last)


def _interleave(case: Case, sending: Sending) -> Step:
    """Hold the transfer for the next one of its session, then let their frames take turns."""
    session = same(sending)
    if len(sending.frames) < 2 or case.state.setdefault("session", session) != session:
        return Step.SKIP
    waiting: Sending | None = case.state.get("waiting")
    if waiting is None:
        case.state["waiting"], case.state["frames"] = sending, sending.frames
        sending.frames = []
        return Step.MORE
    waiting.frames = case.state["frames"]
    for frame in waiting.frames:
        frame.sending = waiting
    turns = zip(waiting.frames, sending.frames, strict=False)
    mixed = [frame for both in turns for frame in both]
    rest = len(mixed) // 2
    sending.frames = [*mixed, *waiting.frames[rest:], *sending.frames[rest:]]
    case.say(f"the frames of transfer IDs {waiting.transfer_id} and {sending.transfer_id} of one session take turns")
    return Step.DONE


def _second(case: Case) -> None:
    """Record all traffic on both interfaces from now on, but for one transfer."""
    world, begin = case.world, case.world.now
    missing: list[Sending] = []

    def twin(frame: SimulatedFrame) -> SimulatedFrame | None:
        sending = frame.sending
        if frame.bus or (sending is not None and (sending.t < begin or sending in missing)):
            return None
        return replace(frame, bus=1, t=frame.t + _LATER)

    def leave_out(case: Case, sending: Sending) -> Step:
        if not _shows(case, sending) or unshown(sending):
            return Step.SKIP
        missing.append(sending)
        case.mark(sending)
        case.say(f"a second interface shows the same bus, but not transfer ID {sending.transfer_id} of this session")
        return Step.DONE

    world.copy(twin)
    world.at(begin + _BOTH, lambda: case.touch("frames", leave_out))


FAULTS: tuple[Fault, ...] = (
    Fault(
        "TRF-007",
        "a transfer is not finished in time",
        start=_pause,
        options={"pause": 2.5},
        lasts=2600 * MILLISECOND,
    ),
    Fault("TRF-008", "the recording ends inside a transfer", start=_cut, lasts=_BEFORE_THE_END, late=True),
    Fault(
        "TRF-026",
        "two transfers of one session are interleaved",
        frames=_interleave,
        fits=telemetry,
        also=("TRF-006",),
    ),
    Fault(
        "TRF-027",
        "a long pause inside a transfer",
        start=_pause,
        options={"pause": 0.3},
        lasts=400 * MILLISECOND,
    ),
    Fault(
        "TRF-028",
        "one of two interfaces misses a transfer",
        start=_second,
        also=("TRF-016",),
        lasts=SECOND,
    ),
)
