"""Why a transfer is broken: what would have to be different for its CRC to be right.

Everything here is a question about bytes. An answer by CRC is wrong once in 65536 attempts, so attempts are few.
"""

from __future__ import annotations

from binascii import crc_hqx
from functools import cache
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.rules.definitions import CRC_BEGIN, crc_start

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from dissectors.conformance import Words

LOST, LOST_SEVERAL = "one frame lost", "several frames lost"
WRONG_BIT = "wrong toggle bit at the sender"
SWAPPED = "frames swapped"
REPEATED = "a frame repeated later"
OTHER_SENDER = "frames of another sender in between"
OTHER_ID = "a frame with another transfer ID"
UNPROVEN = "a frame lost or out of order"  # nothing is known that the CRC could be checked with
NO_ORDER = "its frames fit in no order"

NO_SIGNATURE = "no signature"
BYTES_SWAPPED = "CRC bytes swapped"
CRC_BEHIND = "CRC behind the payload"

_START, _END, _TOGGLE, _ID = 0x80, 0x40, 0x20, 0x1F
_FEW = 6  # frames whose every order is tried
_MANY = 256  # frames above which none is
_ROOM, _FD_ROOM = 7, 63
MOST_PADDING = 63  # zeros that a last frame may have been filled up with


class Part(NamedTuple):
    """A frame of a session: its number, its tail byte, and the bytes before that."""

    number: int
    tail: int
    body: bytes

    @property
    def toggle(self) -> bool:
        """The toggle bit."""
        return bool(self.tail & _TOGGLE)

    @property
    def start(self) -> bool:
        """Whether a transfer begins here."""
        return bool(self.tail & _START)

    @property
    def end(self) -> bool:
        """Whether a transfer ends here."""
        return bool(self.tail & _END)

    @property
    def transfer_id(self) -> int:
        """The transfer ID, 0 to 31."""
        return self.tail & _ID


class Expected(NamedTuple):
    """What is known of the type: values that its CRC may start from, payload bytes if they never change."""

    starts: Sequence[int]
    size: int | None
    fd: bool = False

    def fits(self, order: Sequence[Part]) -> bool:
        """Whether these frames are a whole transfer with the right CRC, whatever their toggles."""
        joined = b"".join(part.body for part in order)
        payload = joined[2:]
        if not order[-1].end or len(joined) < 2 or (self.size is not None and len(payload) < self.size):
            return False
        wire = int.from_bytes(joined[:2], "little")
        return any(crc_hqx(payload, start) == wire for start in self.starts)

    def frames(self) -> int | None:
        """Frames that a transfer needs, if that never changes."""
        return None if self.size is None else -(-(self.size + 2) // (_FD_ROOM if self.fd else _ROOM))


class Cause(NamedTuple):
    """`what` is the same for all transfers that the same thing happened to, `detail` is of this one."""

    what: str
    detail: str = ""


def break_at(parts: Sequence[Part]) -> int:
    """Which frame (from 0) is the first with the toggle of the one before it; the last if there is none."""
    return next((k for k, (one, after) in enumerate(pairwise(parts), 1) if one.toggle == after.toggle), len(parts) - 1)


def broken_sequence(parts: Sequence[Part], around: Sequence[Part], expected: Expected) -> Cause:
    """Why the toggles of a transfer do not alternate (4.1.3).

    Args:
        parts: its frames, in the order in which they came.
        around: frames near it, of its session but of no transfer, which may belong here.
        expected: what is known of its type.
    """
    if not expected.starts:
        return Cause(UNPROVEN)
    if expected.fits(parts):
        return Cause(WRONG_BIT)
    pool = sorted((*parts, *around))
    for order in _orders(pool):
        if expected.fits(order):
            return _difference(order, pool, parts[0].transfer_id)
    return _lost(parts, expected)


def _difference(order: Sequence[Part], pool: Sequence[Part], transfer_id: int) -> Cause:
    """What separates the order that is right from the one that came."""
    if any(part.transfer_id != transfer_id for part in order):
        strange = next(part for part in order if part.transfer_id != transfer_id)
        return Cause(OTHER_ID, f" (frame {strange.number + 1} belongs to it)")
    if any(after.number < one.number for one, after in pairwise(order)):
        return Cause(SWAPPED, f" (right order: {', '.join(str(part.number + 1) for part in order)})")
    rest = [part for part in pool if part not in order and part.transfer_id == transfer_id]
    own = {part[1:] for part in order}
    what = REPEATED if all(part[1:] in own for part in rest) else OTHER_SENDER
    return Cause(what, f" (too much: {', '.join(str(part.number + 1) for part in rest)})")


def _lost(parts: Sequence[Part], expected: Expected) -> Cause:
    at, total = break_at(parts), expected.frames()
    missing = sum(one.toggle == after.toggle for one, after in pairwise(parts))
    if parts[-1].end:
        if total is not None and total - len(parts) < missing:
            return Cause(NO_ORDER)
        missing = missing if total is None else total - len(parts)
        total = len(parts) + missing
    if missing > 1:
        return Cause(LOST_SEVERAL, f" ({missing} of {total or 'all'}, from the {ordinal(at + 1)} on)")
    return Cause(LOST, f" (the {ordinal(at + 1)}{f' of {total}' if total else ''})")


def ordinal(number: int) -> str:
    """`1st`, `2nd`, `3rd`, `4th`, and so on."""
    ending = "th" if number % 100 in {11, 12, 13} else {1: "st", 2: "nd", 3: "rd"}.get(number % 10, "th")
    return f"{number}{ending}"


def _orders(pool: Sequence[Part]) -> Iterator[list[Part]]:
    """Sequences of frames with right tails that might be what was sent, the likely ones first."""
    if len(pool) > _MANY:
        return
    if len(pool) <= _FEW:
        yield from _all_orders(pool, [])
        return
    for order in _near_orders(pool):
        if _tails_right(order):
            yield order


def _all_orders(pool: Sequence[Part], begun: list[Part]) -> Iterator[list[Part]]:
    """Every way from a start to an end whose toggles alternate."""
    for part in pool:
        if part in begun or part.start != (not begun) or part.toggle != bool(len(begun) & 1):
            continue
        if not part.end:
            yield from _all_orders(pool, [*begun, part])
        elif begun:
            yield [*begun, part]


def _near_orders(pool: Sequence[Part]) -> Iterator[list[Part]]:
    """As they came, neighbours swapped, one frame left out, every second frame left out."""
    frames = list(pool)
    yield frames
    for k in range(len(frames) - 1):
        yield [*frames[:k], frames[k + 1], frames[k], *frames[k + 2 :]]
    for k in range(len(frames)):
        yield [*frames[:k], *frames[k + 1 :]]
    yield frames[::2]
    yield frames[1::2]
    yield [*frames[:1], *frames[2::2]]
    yield [*frames[:1], *frames[1::2]]


def _tails_right(order: Sequence[Part]) -> bool:
    last = len(order) - 1
    return all(
        part.start == (k == 0) and part.end == (k == last) and part.toggle == bool(k & 1)
        for k, part in enumerate(order)
    )  # fmt: skip


def wrong_crc(wire: int, payload: bytes, signatures: Sequence[int], mistaken: Mapping[int, str]) -> str:
    """Which mistake of a sender gives the CRC `wire`, the first that fits; nothing if none does.

    Args:
        wire: the CRC as received, the first two bytes of the transfer.
        payload: all bytes behind it.
        signatures: those of the type.
        mistaken: other signatures that a sender may take, with the names that give them.
    """
    for signature, name in mistaken.items():
        if crc_hqx(payload, crc_start(signature)) == wire:
            return f"the signature of {name}"
    if crc_hqx(payload, CRC_BEGIN) == wire:
        return NO_SIGNATURE
    starts = [crc_start(signature) for signature in signatures]
    turned = (wire & 0xFF) << 8 | wire >> 8
    if any(crc_hqx(payload, start) == turned for start in starts):
        return BYTES_SWAPPED
    joined = wire.to_bytes(2, "little") + payload
    behind = int.from_bytes(joined[-2:], "little")
    if any(crc_hqx(joined[:-2], start) == behind for start in starts):
        return CRC_BEHIND
    zeros = min(len(payload) - len(payload.rstrip(b"\0")), MOST_PADDING)
    for count in range(1, zeros + 1):
        if any(crc_hqx(payload[:-count], start) == wire for start in starts):
            return f"{count} zero byte{'s' if count > 1 else ''} at the end left out"
    return ""


def starts_of(wire: Words, payloads: Sequence[bytes]) -> Words:
    """From which values the CRC of each payload ends as `wire` (integers, as many): the CRC run backwards."""
    table, index_of = _tables()
    lengths = np.array([len(payload) for payload in payloads], np.int64)
    order = np.argsort(-lengths, kind="stable")
    ends = np.cumsum(lengths)[order]
    data = np.frombuffer(b"".join(payloads), np.uint8)
    value = np.asarray(wire, np.int64)[order]
    rows = np.searchsorted(-lengths[order], -np.arange(int(lengths.max(initial=0))), side="left")
    for step, active in enumerate(rows.tolist(), 1):
        byte = data[ends[:active] - step]
        now = value[:active]
        index = index_of[now & 0xFF]
        value[:active] = (index ^ byte) << 8 | (now ^ table[index]) >> 8
    found = np.empty_like(value)
    found[order] = value
    return found


@cache
def _tables() -> tuple[Words, Words]:
    """What one byte does to a CRC of 0, and the byte by the low half of that."""
    table = np.array([crc_hqx(bytes((byte,)), 0) for byte in range(256)], np.int64)
    index_of = np.empty(256, np.int64)
    index_of[table & 0xFF] = np.arange(256)
    return table, index_of
