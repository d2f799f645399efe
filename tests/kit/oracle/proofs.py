"""Why a transfer is broken: what would have to be different for its CRC to be right, or which frames are missing.

Everything here is a question about bytes. An answer by CRC is wrong once in 65536 attempts, so attempts are few.
"""

from __future__ import annotations

from binascii import crc_hqx
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

from analyzer.rules.diagnosis.causes import (
    EITHER,
    END_BIT,
    EVERY_END,
    EVERY_ID,
    EVERY_START,
    OTHER_ID,
    OTHER_SENDER,
    REPEATED,
    START_BIT,
    SWAPPED,
    WRONG_BIT,
    Cause,
)  # fmt: skip
from analyzer.tables import TAIL_END, TAIL_ID, TAIL_START, TAIL_TOGGLE, TRANSFER_IDS

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

_FEW = 6  # frames whose every order is tried
_MANY = 256  # frames above which none is
_FLIPPED = 24  # frames above which no bit of a tail byte is turned
_ROOM, _FD_ROOM = 7, 63


class Part(NamedTuple):
    """A frame of a session: its number, its tail byte, and the bytes before that."""

    number: int
    tail: int
    body: bytes

    @property
    def toggle(self) -> bool:
        """The toggle bit."""
        return bool(self.tail & TAIL_TOGGLE)

    @property
    def start(self) -> bool:
        """Return whether a transfer begins here."""
        return bool(self.tail & TAIL_START)

    @property
    def end(self) -> bool:
        """Return whether a transfer ends here."""
        return bool(self.tail & TAIL_END)

    @property
    def transfer_id(self) -> int:
        """The transfer ID, 0 to 31."""
        return self.tail & TAIL_ID


class KnownType(NamedTuple):
    """A type, as far as it is known: values that its CRC may start from, payload bytes if they never change.

    `lengths` are (frames, bytes before the tail of the last one) of whole transfers that the sender sent nearby,
    `singles` the bytes before the tail of those in one frame.
    """

    starts: Sequence[int]
    size: int | None
    fd: bool = False
    lengths: frozenset[tuple[int, int]] = frozenset()
    singles: frozenset[int] = frozenset()

    @property
    def room(self) -> int:
        """Bytes before the tail of a full frame."""
        return _FD_ROOM if self.fd else _ROOM

    def fits(self, order: Sequence[Part]) -> bool:
        """Return whether these frames are a whole transfer with the right CRC, whatever their toggles."""
        joined = b"".join(part.body for part in order)
        payload = joined[2:]
        if not order or not order[-1].end or len(joined) < 2 or (self.size is not None and len(payload) < self.size):
            return False
        wire = int.from_bytes(joined[:2], "little")
        return any(crc_hqx(payload, start) == wire for start in self.starts)

    def frames(self) -> int | None:
        """Return frames that a transfer needs, if that never changes."""
        if self.size is None:
            return None
        return 1 if self.size <= self.room else -(-(self.size + 2) // self.room)


class Proof(NamedTuple):
    """A cause, and the frames as they were meant: their CRC is right."""

    cause: Cause
    order: Sequence[Part]


def break_at(parts: Sequence[Part]) -> int:
    """Return which frame (from 0) is the first with the toggle of the one before it; the last if there is none."""
    return next((k for k, (one, after) in enumerate(pairwise(parts), 1) if one.toggle == after.toggle), len(parts) - 1)


def proven(parts: Sequence[Part], around: Sequence[Part], expected: KnownType) -> Proof | None:
    """Return what must be different for the CRC to be right; None if nothing is found.

    Args:
        parts: the frames of a broken transfer, or what is left of one, in the order in which they came.
        around: frames near it, of its session but of no whole transfer, which may belong here.
        expected: what is known of its type.
    """
    if not expected.starts or not parts:
        return None
    pool = sorted((*parts, *around))
    transfer_id = parts[0].transfer_id
    inside = [part for part in pool if parts[0].number <= part.number <= parts[-1].number]
    own = [part for part in inside if part.transfer_id == transfer_id]
    for order in (list(parts), own):
        if not _tails_right(order) and _ends_right(order) and expected.fits(order):
            return Proof(Cause(EITHER if _swappable(order) else WRONG_BIT), order)
    turned = _one_bit_turned(pool, transfer_id, expected)
    if turned is not None:
        return turned
    for order in _orders(pool):
        if order != list(parts) and expected.fits(order):
            cause = _difference(order, pool, transfer_id)
            if cause is not None:
                return Proof(cause, order)
    return None


def _swappable(order: Sequence[Part]) -> bool:
    """Return whether two equal neighbours have each the toggle that the other one should have."""
    wrong = [k for k, part in enumerate(order) if part.toggle != bool(k & 1)]
    return len(wrong) == 2 and wrong[1] - wrong[0] == 1 and order[wrong[0]].body == order[wrong[1]].body


def _one_bit_turned(pool: Sequence[Part], transfer_id: int, expected: KnownType) -> Proof | None:
    """Find one frame whose start or end bit is wrong: with the other one the transfer is whole."""
    if len(pool) > _FLIPPED:
        return None
    own = [part for part in pool if part.transfer_id == transfer_id]
    for k, part in enumerate(own):
        for bit, what in ((TAIL_END, END_BIT), (TAIL_START, START_BIT)):
            right = [*own[:k], part._replace(tail=part.tail ^ bit), *own[k + 1 :]]
            for first in (at for at, one in enumerate(right) if one.start and at <= k):
                end = next((at for at in range(first, len(right)) if right[at].end), first)
                order, next_one = right[first : end + 1], right[end + 1 : end + 2]
                alone = k <= end and len(order) > 1 and all(one.start for one in next_one)
                if alone and _tails_right(order) and expected.fits(order):
                    return Proof(Cause(what, f" (frame {part.number + 1})"), order)
    return None


def _difference(order: Sequence[Part], pool: Sequence[Part], transfer_id: int) -> Cause | None:
    """Return what separates the order that is right from the one that came."""
    if any(part.transfer_id != transfer_id for part in order):
        strange = next(part for part in order if part.transfer_id != transfer_id)
        return Cause(OTHER_ID, f" in frame {strange.number + 1}")
    if any(after.number < one.number for one, after in pairwise(order)):
        return Cause(SWAPPED, f" (right order: {', '.join(str(part.number + 1) for part in order)})")
    rest = [part for part in pool if part not in order and part.transfer_id == transfer_id]
    if not rest:
        return None
    own = {part[1:] for part in order}
    what = REPEATED if all(part[1:] in own for part in rest) else OTHER_SENDER
    return Cause(what, f" (too much: {', '.join(str(part.number + 1) for part in rest)})")


def _orders(pool: Sequence[Part]) -> Iterator[list[Part]]:
    """Yield sequences of frames with right tails that might be what was sent, the likely ones first."""
    if len(pool) > _MANY:
        return
    if len(pool) <= _FEW:
        yield from _all_orders(pool, [])
        return
    for order in _near_orders(pool):
        if _tails_right(order):
            yield order


def _all_orders(pool: Sequence[Part], begun: list[Part]) -> Iterator[list[Part]]:
    """Yield every way from a start to an end whose toggles alternate."""
    for part in pool:
        if part in begun or part.start != (not begun) or part.toggle != bool(len(begun) & 1):
            continue
        if not part.end:
            yield from _all_orders(pool, [*begun, part])
        elif begun:
            yield [*begun, part]


def _near_orders(pool: Sequence[Part]) -> Iterator[list[Part]]:
    """Yield the frames as they came, two close ones swapped, one left out, every second left out, all turned around."""
    frames = list(pool)
    yield frames
    for apart in (1, 2):
        for k in range(len(frames) - apart):
            swapped = list(frames)
            swapped[k], swapped[k + apart] = frames[k + apart], frames[k]
            yield swapped
    for k in range(len(frames)):
        yield [*frames[:k], *frames[k + 1 :]]
    yield frames[::2]
    yield frames[1::2]
    yield [*frames[:1], *frames[2::2]]
    yield [*frames[:1], *frames[1::2]]
    yield frames[::-1]
    for k in range(1, len(frames)):
        yield [*frames[k:], *frames[:k]]


def _tails_right(order: Sequence[Part]) -> bool:
    return _ends_right(order) and all(part.toggle == bool(k & 1) for k, part in enumerate(order))


def _ends_right(order: Sequence[Part]) -> bool:
    last = len(order) - 1
    return all(part.start == (k == 0) and part.end == (k == last) for k, part in enumerate(order))


def in_a_row(parts: Sequence[Part], near: Sequence[Part], expected: KnownType) -> Proof | None:
    """Return the transfer that frames make without a start, end or ID bit that tears them apart.

    None if the CRC is wrong.

    Args:
        parts: frames of a broken transfer, or what is left of one.
        near: all frames of its session around it, in order.
        expected: what is known of its type.
    """
    if not expected.starts:
        return None
    own = [part for part in near if part.transfer_id == parts[0].transfer_id]
    at = next((k for k, part in enumerate(own) if part.number == parts[0].number), None)
    if at is None:
        return None
    return _row_ends(own, at, expected) or _row_starts(own, at, expected) or _other_id(parts, near, expected)


def _row_ends(own: Sequence[Part], at: int, expected: KnownType) -> Proof | None:
    """Look from a start to before the next one, with ends in between."""
    first = next((k for k in range(at, -1, -1) if own[k].start), 0)
    behind = next((k for k in range(first + 1, len(own)) if own[k].start), len(own))
    order = own[first:behind]
    wrong = [part for part in order[:-1] if part.end]
    return _row_proof(order, wrong, (END_BIT, EVERY_END), expected)


def _row_starts(own: Sequence[Part], at: int, expected: KnownType) -> Proof | None:
    """Look from behind an end to the next one, with starts in between."""
    first = next((k for k in range(at, 0, -1) if own[k - 1].end), 0)
    last = next((k for k in range(at, len(own)) if own[k].end), len(own) - 1)
    order = own[first : last + 1]
    wrong = [part for part in order[1:] if part.start]
    return _row_proof(order, wrong, (START_BIT, EVERY_START), expected)


def _row_proof(
    order: Sequence[Part], wrong: Sequence[Part], what: tuple[str, str], expected: KnownType
) -> Proof | None:
    """Prove one wrong bit, or the same in every frame."""
    if not wrong or not order[0].start or not _alternate(order) or not expected.fits(order):
        return None
    one, every = what
    if len(wrong) == 1:
        return Proof(Cause(one, f" (frame {wrong[0].number + 1})"), order)
    return Proof(Cause(every), order) if len(wrong) == len(order) - 1 else None


def _other_id(parts: Sequence[Part], near: Sequence[Part], expected: KnownType) -> Proof | None:
    """Look for a first frame, and behind it the rest of a transfer with another ID, or with one more in each frame."""
    at = next(k for k, part in enumerate(near) if part.number == parts[0].number)
    first = next((k for k in range(at, -1, -1) if near[k].start), 0)
    end = next((k for k in range(first + 1, len(near)) if near[k].end or near[k].start), first)
    order = near[first : end + 1]
    begins = [part.start for part in order] == [True] + [False] * (end - first)
    if first == end or not begins or order[0].end or not _alternate(order) or not expected.fits(order):
        return None
    ids = [part.transfer_id for part in order]
    if len(ids) > 2 and all((after - one) % TRANSFER_IDS == 1 for one, after in pairwise(ids)):
        return Proof(Cause(EVERY_ID), order)
    apart = order[0] not in parts if not parts[0].start else len(parts) == 1
    if not apart or ids[0] == ids[1] or len({*ids[1:]}) > 1:
        return None
    other = f" or {order[1].number + 1}" if len(order) == 2 else ""  # nobody knows which
    return Proof(Cause(OTHER_ID, f" in frame {order[0].number + 1}{other}"), order)


def _alternate(order: Sequence[Part]) -> bool:
    return all(part.toggle == bool(k & 1) for k, part in enumerate(order))
