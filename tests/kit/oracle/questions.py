"""What rules ask of frames that are no whole transfer, answered from the frames around them."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

from analyzer.rules.diagnosis import causes
from analyzer.rules.diagnosis.causes import EVERY_ID, NO_ORDER, Cause
from kit.encode import crc16
from kit.oracle.neighbours import missing
from kit.oracle.proofs import Proof, in_a_row, proven

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kit.oracle.neighbours import Neighbours
    from kit.oracle.proofs import Part

_TWO = 2


class Told(NamedTuple):
    """A cause, None for nothing; what else is known, by name; frames that show it; a value."""

    cause: Cause | None
    known: frozenset[str] = frozenset()
    evidence: Sequence[int] = ()
    value: int = -1


def broken(here: Neighbours, times: dict[int, int]) -> Told:
    """Return why a transfer is broken; the value is the earliest time behind it."""
    around, copy = here.around(), _copy(here)
    proof = None if copy is not None else proven(here.parts, around, here.expected)
    row = None if proof is not None or copy is not None else in_a_row(here.parts, here.near, here.expected)
    same_id = [part for part in around if part.transfer_id == here.parts[0].transfer_id]
    known = set()
    if copy is not None:
        cause = copy
    elif proof is not None:
        known.add("proven")
        cause = _surely(proof.cause, here)
        if _belongs_to_another(cause, proof.order, here.parts, around):
            known.add("later")
    elif row is not None:
        cause = row.cause
        if row.order[0] not in here.parts:
            known.add("elsewhere")
    else:
        cause = missing(here.parts, here.expected) or Cause(NO_ORDER)
        if not here.expected.starts and same_id:
            cause = Cause(causes.UNPROVEN)
    wrong = _misnumbered(proof or row, here)
    if wrong:
        known.add("misnumbered")
        cause = causes.wrong_id([part.number for part in wrong])
    behind = [times[part.number] for part in here.near if part.number > here.parts[-1].number]
    return Told(cause, frozenset(known), [part.number for part in same_id], min(behind, default=(1 << 63) - 1))


def checksum(here: Neighbours) -> Told:
    """Return why a CRC is wrong; the value is the start that most wrong ones nearby have in common."""
    around = here.around()
    proof = proven(here.parts, around, here.expected)
    if proof is not None:
        order = {part.number for part in proof.order}
        elsewhere = proof.order[0] not in here.parts and proof.cause.what == causes.START_BIT
        known = frozenset({"proven", "elsewhere"} if elsewhere else {"proven"})
        return Told(proof.cause, known, [part.number for part in around if part.number in order])
    short = next((part for part in here.parts[:-1] if len(part.body) < here.expected.room), None)
    if short is None:
        cause = missing(here.parts, here.expected)
    else:
        size = f"{len(short.body) + 1} bytes in frame {short.number + 1}"
        cause = Cause(causes.SHORT_FRAME, f" ({size}, TRF-012)")
    return Told(cause, frozenset({"lengths"} if here.expected.lengths else ()), value=_shared(here))


def _shared(here: Neighbours) -> int:
    runs = [run for run in here.whole if not here.expected.fits(run)]
    wrong = [(b"".join(part.body for part in run), run[0].transfer_id) for run in runs]
    mine = b"".join(part.body for part in here.parts)
    if len(mine) < _TWO:
        return -1
    others = [
        joined
        for joined, number in wrong
        if (joined, number) != (mine, here.parts[0].transfer_id) and len(joined) > _TWO
    ]
    start = _start_of(mine)
    same = sum(_start_of(joined) == start for joined in others)
    return start if same and 2 * same >= len(others) else -1


def _start_of(joined: bytes) -> int:
    """Return the start value from which a CRC comes out as it is: bit by bit backwards, as the polynomial is odd."""
    value = int.from_bytes(joined[:2], "little")
    for byte in reversed(joined[2:]):
        for _ in range(8):
            value = (value ^ 0x1021) >> 1 | 0x8000 if value & 1 else value >> 1
        value ^= byte << 8
    assert crc16(joined[2:], value).to_bytes(2, "little") == joined[:2]
    return value


def _copy(here: Neighbours) -> Cause | None:
    """Return the cause of a copy, unless a sender counts every frame: its tail bytes come round by themselves."""
    copy = here.copy()
    row = None if copy is None else in_a_row(here.parts, here.near, here.expected)
    return None if row is not None and row.cause.what == EVERY_ID else copy


def _misnumbered(proof: Proof | None, here: Neighbours) -> list[Part]:
    """Return the first frame of a transfer of two if its ID is wrong, both if nobody knows, none if it is right."""
    if proof is None or proof.cause.what != causes.OTHER_ID or len(proof.order) != _TWO:
        return []
    wrong = here.misnumbered(proof.order)
    return wrong if proof.order[0] in wrong else []


def _surely(cause: Cause, here: Neighbours) -> Cause:
    """Return the cause; two equal frames that are swapped once and again are toggles that stand still."""
    return Cause(causes.WRONG_BIT) if cause.what == causes.EITHER and here.unsteady() else cause


def _belongs_to_another(cause: Cause, order: Sequence[Part], parts: Sequence[Part], around: Sequence[Part]) -> bool:
    """Return whether the last frame belongs to a later attempt with the same ID, of which the same is said."""
    later = any(part.start and not part.toggle and part.number > parts[-1].number for part in around)
    return later and cause.what in {causes.REPEATED, causes.SWAPPED} and order[-1] not in parts


def remainder(here: Neighbours) -> Cause | None:
    """Return of what a rest without a start is left; None if another transfer says so itself."""
    copy = here.copy()
    if copy is not None:
        return copy
    proof = proven(here.parts, here.around(), here.expected)
    if proof is not None:
        own = {part.number for part in here.parts}
        return proof.cause if all(part.number in own for part in proof.order) else None
    row = in_a_row(here.parts, here.near, here.expected)
    if row is None:
        return missing(here.parts, here.expected)
    # The frames behind a single one with an end bit too many: nothing else tells of them.
    first, second = row.order[:2]
    return row.cause if first.start and first.end and second == here.parts[0] else None


def is_needed(near: Neighbours) -> bool:
    """Return whether a frame that looks like a copy is none.

    Where toggles stand still, or where one between both has another transfer ID, the CRC is right only with it.
    """
    (frame,) = near.parts
    if frame.number in near.settled:
        return False
    run = _from_start(near.near, frame)
    apart = [part for k, part in enumerate(run) if not k or part[1:] != run[k - 1][1:]]
    stands_still = any(one.toggle == after.toggle for one, after in pairwise(apart))
    if (stands_still or len(apart) == 1) and near.expected.fits(run):
        return True
    here = near._replace(parts=apart)
    proof = proven(here.parts, here.around(), near.expected) if apart else None
    return proof is not None and frame in proof.order and sum(part[1:] == frame[1:] for part in proof.order) > 1


def _from_start(near: Sequence[Part], frame: Part) -> list[Part]:
    """Return the transfer around a frame as it came, copies and all: from the start before it to the end behind it."""
    mine = [part for part in near if part.transfer_id == frame.transfer_id]
    first = max((k for k, part in enumerate(mine) if part.start and part.number <= frame.number), default=0)
    while first and mine[first - 1][1:] == mine[first][1:]:
        first -= 1
    last = next((k for k, part in enumerate(mine) if part.end and part.number >= frame.number), len(mine) - 1)
    return mine[first : last + 1]


def inside(near: Neighbours) -> str | None:
    """Return what a frame with another transfer ID does inside a transfer.

    None if it is left of one that was cut itself, or if the ID of the frame before it is or may be wrong (TRF-006).
    """
    (frame,) = near.parts
    copy = near.copy()
    copied = f": {copy.what}{copy.detail}" if copy is not None else ""
    for run in near.whole:
        if run[0].number < frame.number < run[-1].number and run[0].transfer_id != frame.transfer_id:
            right = near.expected.fits(run)
            return copied or (": a foreign frame, the CRC is right without it" if right else "")
    proof = _around(near, frame)
    if proof is not None and frame in proof.order:
        first, *rest = proof.order
        unsure = rest == [frame] and first in near.misnumbered(proof.order)
        return None if unsure else ": it belongs to that one"
    if copied or proof is not None or not near.expected.starts:
        return copied or (": a foreign frame" if proof is not None else "")
    rest = [part for part in near.near if part.number >= frame.number and part.transfer_id == frame.transfer_id]
    end = next((k for k, part in enumerate(rest) if part.end), None)
    right = end is not None and all(one.toggle != after.toggle for one, after in pairwise(rest[: end + 1]))
    return None if right else ""


def _around(near: Neighbours, frame: Part) -> Proof | None:
    """Return what must be different in the transfer that was begun before a frame with another ID, if that is known."""
    before = [part for part in near.near if part.number < frame.number and part.start and not part.end]
    if not before or before[-1].transfer_id == frame.transfer_id:
        return None
    begun = before[-1]
    outer = [part for part in near.near if part.transfer_id == begun.transfer_id and part.number >= begun.number]
    cut = next((k for k, part in enumerate(outer) if k and (part.start or outer[k - 1].end)), len(outer))
    here = near._replace(parts=outer[:cut])
    return proven(here.parts, here.around(), near.expected)
