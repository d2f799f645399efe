"""A transfer that did not arrive as it was sent, and what is said of it."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from analyzer.rules.diagnosis import checksums
from analyzer.rules.diagnosis.causes import Cause
from analyzer.rules.frames.type_conflicts import types_of
from analyzer.rules.view import node_of
from analyzer.tables import TAIL_TOGGLE
from dissectors.frame_text import FrameNumber, FrameText
from dissectors.kit import Occurrence

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from dissectors.kit import Values, View

SEQUENCE, CUT, LATE, CHECKSUM = "TRF-003", "TRF-006", "TRF-007", "TRF-010"
DROPS = {SEQUENCE, CUT, LATE}  # what frames that the recorder lost may explain, whatever the cause
BY_CRC = {CHECKSUM, "TRF-011", "CAN-020"}  # what both CRCs tell
SECONDS = 2.0  # where the core closes a transfer
ROOM = (63, 7)  # bytes before the tail of a full frame: of CAN FD, and else
BY_SEQUENCE = "broken sequence"
Source = tuple[int, int, int]  # bus, node, type


class Incomplete(NamedTuple):
    """A transfer, and the rule that it breaches; CRCs and payload are those of rules that both CRCs tell."""

    rule: str
    t: int
    bus: int
    src: int
    code: int
    fd: bool
    frames: Sequence[int]
    wire: int
    here: int
    payload: bytes
    received: int
    end: int

    @property
    def source(self) -> Source:
        """Bus, node and type."""
        return self.bus, self.src, self.code


FOLLOWS = Cause(BY_SEQUENCE, f" ({SEQUENCE})")


def occurrence(view: View, one: Incomplete, cause: Cause, further: Iterable[int] = ()) -> Occurrence:
    """Return a finding; `further` frames are evidence too."""
    frames = (*one.frames, *further)
    return Occurrence(
        rule=one.rule, t=one.t, bus=one.bus, node=node_of(one.src, one.code), type=view.type_name(one.code),
        frames=frames, drops=one.rule in DROPS, lines=view.lines(frames), values=values_of(view, one, cause),
    )  # fmt: skip


def values_of(view: View, one: Incomplete, cause: Cause) -> Values:
    """Return what the text of its rule is filled with."""
    if one.rule == SEQUENCE:
        return {"cause": cause.what, "detail": cause.detail, "frame": FrameNumber.at(_break_at(view, one.frames))}
    why = {"cause": cause.what, "why": cause.behind(": ")}
    if one.rule == CUT:
        return why | {"frames": len(one.frames), "bytes": one.received}
    if one.rule == LATE:
        return why | {"seconds": SECONDS}
    if one.rule == CHECKSUM:
        return why | {"crc_wire": one.wire, "crc_here": one.here}
    if one.rule == "TRF-011":
        return {"cause": cause.what, "detail": cause.detail}
    return types_of(view, one.code, cause.what)


def _break_at(view: View, frames: Sequence[int]) -> int:
    """Return the first frame with the toggle of the one before it, the last one if there is none."""
    last, before = frames[0], -1
    for number in frames:
        one = view.frame(number)
        if one is not None and one.data:
            last, toggle = number, one.data[-1] & TAIL_TOGGLE
            if toggle == before:
                break
            before = toggle
    return last


def turned_bit(one: Incomplete) -> Cause:
    """Return the cause: corrupted, and where, if one turned bit explains it."""
    at = checksums.one_bit(one.wire ^ one.here, len(one.payload))
    place = None if at is None else checksums.BytePlace.of(at, ROOM[0] if one.fd else ROOM[1])
    if place is None or place.frame >= len(one.frames):
        return Cause(checksums.CORRUPTED)
    frame = FrameNumber.at(one.frames[place.frame])
    return Cause(checksums.CORRUPTED, FrameText(f" (one bit turned in byte {place.byte} of frame ", frame, ")"))


def corrupted(wire: int, here: int, length: int, frames: Sequence[int], *, fd: bool) -> Values:
    """Return what is said of a transfer whose CRC is `wire` and should be `here`, if nothing but its bytes is known."""
    one = Incomplete(CHECKSUM, 0, 0, 0, 0, fd, frames, wire, here, bytes(length), length, 0)
    cause = turned_bit(one)
    return {"crc_wire": wire, "crc_here": here, "cause": cause.what, "why": cause.behind(": ")}
