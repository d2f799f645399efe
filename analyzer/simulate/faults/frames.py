"""Faults of single frames (CAN rules): what no controller should put on this bus, in a node's own sessions."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from analyzer.simulate import wire
from analyzer.simulate.faults import foreign, identifiers
from analyzer.simulate.faults.helpers import number, telemetry
from dissectors.traffic import Fault, SimulatedFrame, Step

if TYPE_CHECKING:
    from dissectors.traffic import Case, Sending

_PRIORITY = 24


def flexible(sending: Sending) -> bool:
    """Cut a transfer into CAN FD frames; not what has another layout there, a length before its last array."""
    message = sending.message
    if message.max_bytes != message.max_bytes_with_length:
        return False
    body = sending.payload if len(sending.payload) < 64 else wire.checked(sending.payload, sending.signature)
    sending.frames = wire.cut(wire.can_id(sending), body, sending.transfer_id, fd=True)
    return True


def _behind(case: Case, sending: Sending, frame: SimulatedFrame) -> Step:
    """Send one more frame behind the transfer, with its identifier."""
    frame.sending = sending
    sending.frames.append(frame)
    case.mark(frame)
    return Step.DONE


def _remote(case: Case, sending: Sending) -> Step:
    case.say(f"a remote frame that asks for {number(case, 'dlc')} bytes, with the identifier of the transfer before it")
    return _behind(case, sending, SimulatedFrame(sending.frames[0].id, b"", remote=True, dlc=number(case, "dlc")))


def _empty(case: Case, sending: Sending) -> Step:
    case.say("a data frame without data behind a transfer, with its identifier")
    return _behind(case, sending, SimulatedFrame(sending.frames[0].id, b""))


def _fd(case: Case, sending: Sending) -> Step:
    classic = len(sending.frames)
    if not flexible(sending):
        return Step.SKIP
    sizes = "+".join(str(len(frame.data)) for frame in sending.frames)
    case.say(f"a transfer was sent in CAN FD, {sizes} bytes in a frame, instead of {classic} classic")
    return Step.DONE


def _impossible(case: Case, sending: Sending) -> Step:
    """Send a CAN FD frame without the padding that would fill it."""
    if len(sending.payload) in {*range(8), 11, 15, 19, 23, 31, 47} or len(sending.payload) > 63:
        return Step.SKIP
    if not flexible(sending):
        return Step.SKIP
    (frame,) = sending.frames
    sending.frames = [replace(frame, data=sending.payload + frame.data[-1:])]
    case.say(f"a CAN FD frame of {len(sending.payload) + 1} bytes, for which there is no length code")
    return Step.DONE


def _priority(case: Case, sending: Sending) -> Step:
    """Make the first frame more urgent than the rest: else arbitration would change their order."""
    frames, priority = sending.frames, sending.priority
    if len(frames) < 2:
        return Step.SKIP
    if priority:
        frames[0].id -= 1 << _PRIORITY
        first, rest = priority - 1, priority
    else:
        for frame in frames[1:]:
            frame.id += 1 << _PRIORITY
        first, rest = 0, 1
    case.say(f"the first of {len(frames)} frames has priority {first}, the rest {rest}")
    return Step.DONE


_OWN: tuple[Fault, ...] = (
    Fault(
        "CAN-002",
        "a remote frame",
        frames=_remote,
        fits=telemetry,
        options={"dlc": 8},
        limits={"dlc": (0, 8)},
        harmless=True,
        exact=True,
    ),
    Fault("CAN-003", "a transfer in CAN FD frames", frames=_fd, fits=telemetry, harmless=True),
    Fault("CAN-005", "a frame without a tail byte", frames=_empty, fits=telemetry, harmless=True, exact=True),
    Fault("CAN-014", "the priority changes inside a transfer", frames=_priority, fits=telemetry, also=("CAN-013",)),
    Fault("CAN-019", "a frame of impossible length", frames=_impossible, fits=telemetry, also=("CAN-003",)),
)

FAULTS: tuple[Fault, ...] = (*_OWN, *foreign.FAULTS, *identifiers.FAULTS)
