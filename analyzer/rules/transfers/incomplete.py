"""A transfer that did not arrive as it was sent, and what is said of it."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from analyzer.rules.diagnosis import checksums, proofs
from analyzer.rules.diagnosis.neighbours import parts_of
from analyzer.rules.diagnosis.proofs import Cause
from analyzer.rules.frames.type_conflicts import types_of
from analyzer.rules.view import node_of
from dissectors.kit import Occurrence
from dissectors.records import replace

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from dissectors.kit import TransferTable, Values, View

SEQUENCE, CUT, LATE, CHECKSUM = "TRF-003", "TRF-006", "TRF-007", "TRF-010"
DROPS = {SEQUENCE, CUT, LATE}  # what frames that the recorder lost may explain, whatever the cause
BY_CRC = {CHECKSUM, "TRF-011", "CAN-020"}  # what both CRCs tell
SECONDS = 2.0  # where the core closes a transfer
BY_SEQUENCE = "broken sequence"


class Incomplete(NamedTuple):
    """A transfer, and the rule that it breaches."""

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
    ended: str = ""  # the rule that its missing end breaches, if another one says why

    @property
    def sender(self) -> tuple[int, int, int]:
        """Bus, node and type."""
        return self.bus, self.src, self.code

    @property
    def shape(self) -> tuple[int, int]:
        """Frames and bytes that came."""
        return len(self.frames), self.received


FOLLOWS = Cause(BY_SEQUENCE, f" ({SEQUENCE})")


def take_row(t: TransferTable, rule: str, row: int, ended: str = "") -> Incomplete:
    """Return the transfer in a row of a batch, as breach of a rule."""
    who = int(t.t[row]), int(t.bus[row]), int(t.src[row]), int(t.code[row]), bool(t.fd[row])
    crc, end = bool(t.has("crc_wire")[row]), int(t.t_end[row])
    wire, here = (int(t.crc_wire[row]), int(t.crc_here[row])) if crc and rule in BY_CRC else (0, 0)
    received = int(t.length[row]) + 2 * crc
    return Incomplete(rule, *who, t.frames(row), wire, here, t.payload(row), received, end, ended=ended)


def with_end(view: View, one: Incomplete, found: Occurrence) -> Iterator[Occurrence]:
    """Yield a finding, and the end that a broken sequence takes with it."""
    yield found
    if one.rule == SEQUENCE and one.ended:
        yield replace(occurrence(view, one._replace(rule=one.ended), FOLLOWS), severity=found.severity)


def occurrence(view: View, one: Incomplete, cause: Cause, further: Iterable[int] = ()) -> Occurrence:
    """Return a finding; `further` frames are evidence too."""
    frames = (*one.frames, *further)
    return Occurrence(
        rule=one.rule, t=one.t, bus=one.bus, node=node_of(one.src, one.code), type=view.type_name(one.code),
        frames=frames, drops=one.rule in DROPS, lines=view.lines(frames), values=values_of(view, one, cause),
    )  # fmt: skip


def values_of(view: View, one: Incomplete, cause: Cause) -> Values:
    """Return what the text of its rule is filled with."""
    why = {"cause": cause.what, "why": f": {cause.what}{cause.detail}"}
    if one.rule == SEQUENCE:
        parts = parts_of(view, one.frames)
        at = parts[proofs.break_at(parts)].number if parts else one.frames[0]
        return {"cause": cause.what, "detail": cause.detail, "frame": at + 1}
    if one.rule == CUT:
        return why | {"frames": len(one.frames), "bytes": one.received}
    if one.rule == LATE:
        return why | {"seconds": SECONDS}
    if one.rule == CHECKSUM:
        return why | {"crc_wire": one.wire, "crc_here": one.here}
    if one.rule == "TRF-011":
        return {"cause": cause.what, "detail": cause.detail}
    return types_of(view, one.code, cause.what)


def turned_bit(one: Incomplete) -> Cause:
    """Return the cause: corrupted, and where, if one turned bit explains it."""
    at = checksums.one_bit(one.wire ^ one.here, len(one.payload))
    place = None if at is None else checksums.BytePlace.of(at, 63 if one.fd else 7)
    if place is None or place.frame >= len(one.frames):
        return Cause(checksums.CORRUPTED)
    return Cause(checksums.CORRUPTED, f" (one bit turned in byte {place.byte} of frame {one.frames[place.frame] + 1})")


def corrupted(wire: int, here: int, length: int, frames: Sequence[int], *, fd: bool) -> Values:
    """Return what is said of a transfer whose CRC is `wire` and should be `here`, if nothing but its bytes is known."""
    one = Incomplete(CHECKSUM, 0, 0, 0, 0, fd, frames, wire, here, bytes(length), length, 0)
    cause = turned_bit(one)
    return {"crc_wire": wire, "crc_here": here, "cause": cause.what, "why": f": {cause.what}{cause.detail}"}
