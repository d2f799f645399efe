"""Faults of transfers (TRF rules): tail bytes and lengths of the frames of one transfer."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.simulate import wire
from analyzer.simulate.faults import counters, integrity, services, timing
from analyzer.simulate.faults.helpers import LOG, beacon, copied, number, sender, telemetry, text, transmit, unshown
from analyzer.simulate.wire import TOGGLE, retail
from dissectors.traffic import Fault, Step

if TYPE_CHECKING:
    from dissectors.traffic import Case, Sending

# Flips one bit of a transfer ID, so that the wrong one is not that of a neighbour.
_OTHER_ID = 0x08


def _single_toggle(case: Case, sending: Sending) -> Step:
    if len(sending.frames) != 1:
        return Step.SKIP
    retail(sending.frames[0], TOGGLE)
    case.say("the only frame of a transfer has toggle 1")
    return Step.DONE


def _first_toggle(case: Case, sending: Sending) -> Step:
    if len(sending.frames) < 2:
        return Step.SKIP
    for frame in sending.frames:
        retail(frame, TOGGLE)
    case.say(f"all {len(sending.frames)} frames have the other toggle: the first starts with 1")
    return Step.DONE


def _toggle(case: Case, sending: Sending) -> Step:
    """Flip a toggle in the middle of the transfer, so that both neighbours show it."""
    frames, how = sending.frames, case.options["how"]
    count = len(frames)
    if count < 3:
        return Step.SKIP
    if how == "lost":
        frames[1].lost = True
        case.say(f"the second of {count} frames was not recorded")
    elif how == "swapped":
        frames[1], frames[2] = frames[2], frames[1]
        case.answer.also = (*case.answer.also, "TRF-005")
        case.say(f"the second and the third of {count} frames were sent in the wrong order")
    else:
        retail(frames[1], TOGGLE)
        case.say(f"the second of {count} frames has toggle 0 like the first")
    return Step.DONE


def _copy(case: Case, sending: Sending) -> Step:
    at, count = number(case, "frame"), len(sending.frames)
    if count < 2 or not 1 <= at <= count:
        return Step.SKIP
    sending.frames[at:at] = copied(sending.frames[at - 1 : at], sending)
    case.say(f"frame {at} of {count} was sent twice")
    return Step.DONE


def _orphan(case: Case, sending: Sending) -> Step:
    if len(sending.frames) < 2 or unshown(sending):
        return Step.SKIP
    sending.frames[0].lost = True
    case.say(f"the first of {len(sending.frames)} frames was not recorded")
    return Step.DONE


def _abandon(case: Case, sending: Sending) -> Step:
    frames, how = sending.frames, case.options["how"]
    count = len(frames)
    if count < 3:
        return Step.SKIP
    if how == "lost":
        frames[-1].lost = True
        case.answer.also = ("TRF-007", "TRF-008")
        case.say(f"the last of {count} frames was not recorded")
    else:
        sending.frames = [*copied(frames[:-1], sending), *frames]
        case.say(f"given up after {count - 1} of {count} frames and begun again with the same transfer ID")
    return Step.DONE


def _renumber(case: Case, sending: Sending) -> Step:
    if len(sending.frames) < 3:
        return Step.SKIP
    right = sending.transfer_id
    retail(sending.frames[1], _OTHER_ID)
    case.say(f"the second of {len(sending.frames)} frames has transfer ID {right ^ _OTHER_ID}, the others {right}")
    return Step.DONE


def recut(sending: Sending, *sizes: int) -> list[bytes]:
    """Cut the bytes of a transfer into frames that hold `sizes` bytes, the rest of them 7; return the parts."""
    body = wire.checked(sending.payload, sending.signature)
    parts = []
    for size in (*sizes, *[7] * len(body)):
        parts.append(body[:size])
        body = body[size:]
        if not body:
            break
    sending.frames = wire.chain(wire.can_id(sending), parts, sending.transfer_id)
    return parts


def _part_full(case: Case, sending: Sending) -> Step:
    if len(sending.frames) < 3:
        return Step.SKIP
    parts = recut(sending, 7, 5)
    case.say(f"the second of {len(parts)} frames has 6 bytes instead of 8")
    return Step.DONE


def _crc_alone(case: Case, sending: Sending) -> Step:
    if len(sending.frames) < 2:
        return Step.SKIP
    parts = recut(sending, 2)
    case.say(f"the first of {len(parts)} frames has 3 bytes: the CRC and the tail")
    return Step.DONE


def _needless(case: Case, sending: Sending) -> Step:
    """Send two frames where one is enough; below 6 bytes the CRC would not fill the first one."""
    if len(sending.frames) != 1 or len(sending.payload) < 6:
        return Step.SKIP
    recut(sending)
    case.say(f"{len(sending.payload)} bytes were sent in two frames with a CRC")
    return Step.DONE


def _nothing_left(case: Case) -> None:
    """Send a text of which nothing is left for the last frame: with its CRC it fills two."""

    def shape(sending: Sending) -> None:
        sending.frames = wire.chain(wire.can_id(sending), [*recut(sending), b""], sending.transfer_id)

    case.say("a transfer that fills two frames ends with a third without payload")
    transmit(case, sender(case), LOG, text("heat 12%"), shape)


_OWN: tuple[Fault, ...] = (
    Fault("TRF-001", "a transfer of one frame has toggle 1", frames=_single_toggle, fits=beacon),
    Fault("TRF-002", "a transfer of several frames starts with toggle 1", frames=_first_toggle, fits=telemetry),
    Fault(
        "TRF-003",
        "the toggle bit does not alternate",
        frames=_toggle,
        fits=telemetry,
        options={"how": "flip"},
        choices={"how": ("flip", "lost", "swapped")},
        also=("TRF-006",),
    ),
    Fault(
        "TRF-004",
        "a frame inside a transfer comes twice",
        frames=_copy,
        fits=telemetry,
        options={"frame": 2},
        harmless=True,
    ),
    Fault(
        "TRF-005",
        "frames without a start: the first one is lost",
        frames=_orphan,
        fits=telemetry,
        also=("TRF-016",),
    ),
    Fault(
        "TRF-006",
        "a transfer is abandoned",
        frames=_abandon,
        fits=telemetry,
        options={"how": "restart"},
        choices={"how": ("restart", "lost")},
    ),
    Fault(
        "TRF-009",
        "the transfer ID changes inside a transfer",
        frames=_renumber,
        fits=telemetry,
        also=("TRF-003", "TRF-006", "TRF-026"),
    ),
    Fault("TRF-012", "a frame that is not the last one is not full", frames=_part_full, fits=telemetry, harmless=True),
    Fault("TRF-013", "the last frame of a transfer has no payload", start=_nothing_left),
    Fault("TRF-014", "the first frame is too short for the CRC", frames=_crc_alone, fits=telemetry, also=("TRF-012",)),
    Fault("TRF-015", "two frames where one is enough", frames=_needless, fits=beacon, harmless=True),
)

FAULTS: tuple[Fault, ...] = (*_OWN, *counters.FAULTS, *integrity.FAULTS, *services.FAULTS, *timing.FAULTS)
