"""Causes of a wrong transfer CRC: mistakes of senders, one turned bit, the CRC run backwards."""

from __future__ import annotations

from binascii import crc_hqx
from functools import cache, lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer._native import crc_starts, mistaken
from analyzer.decode.sent import cells
from analyzer.rules.diagnosis.causes import Cause
from dissectors.kit.definitions import CRC_BEGIN, crc_start

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dissectors.kit import Array, Types

CORRUPTED = "corrupted"
DOUBTFUL = "corrupted, or a wrong signature"  # of a sender without a right CRC nearby
OF = "the signature of "  # and the name of a type
NO_SIGNATURE = "no signature"
FROM_ZERO = "no signature, a CRC that starts from 0"
REVERSED = "the bytes of the signature in reversed order"
BEGUN_AT_ZERO = "a CRC that starts from 0 in front of the signature"
FINAL_XOR = "a final XOR with FFFF"
BYTES_SWAPPED = "CRC bytes swapped"
CRC_BEHIND = "CRC behind the payload"
PADDING = "zero padding"
BY_PAYLOAD = {BYTES_SWAPPED, CRC_BEHIND, PADDING}  # no start value tells these
MOST_PADDING = 63  # zeros that a last frame may have been filled up with
MOST_BYTES = 80  # of a payload in which one turned bit is named: in longer ones it would fit too often by chance


def wrong_crc(wire: int, payload: bytes, signatures: Sequence[int], mistaken: Mapping[int, str]) -> Cause | None:
    """Return which mistake of a sender gives the CRC `wire`, the first that fits; None if none does.

    Args:
        wire: the CRC as received, the first two bytes of the transfer.
        payload: all bytes behind it.
        signatures: those of the type.
        mistaken: other signatures that a sender may take, with the names that give them.
    """
    for signature, name in mistaken.items():
        if crc_hqx(payload, crc_start(signature)) == wire:
            return Cause(OF + name)
    if crc_hqx(payload, CRC_BEGIN) == wire:
        return Cause(NO_SIGNATURE)
    starts = [crc_start(signature) for signature in signatures]
    turned = (wire & 0xFF) << 8 | wire >> 8
    if any(crc_hqx(payload, start) == turned for start in starts):
        return Cause(BYTES_SWAPPED)
    joined = wire.to_bytes(2, "little") + payload
    behind = int.from_bytes(joined[-2:], "little")
    if any(crc_hqx(joined[:-2], start) == behind for start in starts):
        return Cause(CRC_BEHIND)
    zeros = min(len(payload) - len(payload.rstrip(b"\0")), MOST_PADDING)
    for count in range(1, zeros + 1):
        if any(crc_hqx(payload[:-count], start) == wire for start in starts):
            return Cause(PADDING, f": {count} zero byte{'s' if count > 1 else ''} at the end")
    return None


class Formula(NamedTuple):
    """Another way to compute a CRC: what it is called, the value in front of the payload, what is applied behind it."""

    name: str
    start: int
    xor: int = 0

    def gives(self, wire: int, payload: bytes) -> bool:
        """Return whether it gives the CRC of a payload as received."""
        return crc_hqx(payload, self.start) ^ self.xor == wire


def formulas(wire: int, payload: bytes, signatures: Sequence[int]) -> list[Formula]:
    """Return the mistakes that give the CRC `wire`, likely ones first; one alone may do so by chance.

    Args:
        wire: the CRC as received, the first two bytes of the transfer.
        payload: all bytes behind it.
        signatures: those of the type.
    """
    return [way for way in _ways(tuple(signatures)) if way.gives(wire, payload)]


@lru_cache(maxsize=1024)
def _ways(signatures: tuple[int, ...]) -> Sequence[Formula]:
    ways = [Formula(FROM_ZERO, 0)]
    for signature in signatures:
        ways += [
            Formula(REVERSED, crc_hqx(signature.to_bytes(8, "big"), CRC_BEGIN)),
            Formula(BEGUN_AT_ZERO, crc_hqx(signature.to_bytes(8, "little"), 0)),
            Formula(FINAL_XOR, crc_start(signature), 0xFFFF),
        ]
    return ways


class BytePlace(NamedTuple):
    """A byte of a transfer: which frame (from 0), and which byte of it (from 1)."""

    frame: int
    byte: int

    @classmethod
    def of(cls, offset: int, room: int) -> BytePlace:
        """Return the place of a byte of a whole transfer, CRC included, if frames have `room` bytes before the tail."""
        return cls(offset // room, offset % room + 1)


def one_bit(difference: int, length: int) -> int | None:
    """Return which byte (from 0, the CRC's two first) has the one bit that must be turned for the CRC to be right.

    Args:
        difference: the CRC as received, exclusive or the one computed.
        length: bytes of the payload; None is the answer above `MOST_BYTES`.
    """
    if length > MOST_BYTES or not difference:
        return None
    if difference & (difference - 1) == 0:
        return int(difference > 0x80)
    behind = _turned().get(difference, length)
    return None if behind >= length else 1 + length - behind


def one_bit_of_each(difference: Array, length: Array) -> Array:
    """Return the same of many, -1 where no one bit does."""
    behind = _turned_behind()[difference]
    in_crc = difference & (difference - 1) == 0
    fits = (difference != 0) & (length <= MOST_BYTES) & (in_crc | (behind < length))
    return np.where(fits, np.where(in_crc, difference > 0x80, 1 + length - behind), -1)


@cache
def _turned_behind() -> Array:
    """Return how many bytes follow the bit that turns a CRC by so much, too many if no bit does."""
    found = np.full(1 << 16, MOST_BYTES + 1, np.int64)
    for difference, behind in _turned().items():
        found[difference] = behind
    return found


@cache
def _turned() -> Mapping[int, int]:
    """Return what one turned bit does to the CRC, and how many bytes follow it."""
    return {
        crc_hqx(bytes((1 << bit, *bytes(behind))), 0): behind for behind in range(MOST_BYTES) for bit in range(8)
    }  # fmt: skip


def start_of(wire: int, payload: bytes) -> int:
    """Return from which value the CRC of a payload ends as `wire`."""
    begins = np.array([0, len(payload)])
    return int(starts_of_all(np.array([wire]), begins, np.frombuffer(payload, np.uint8))[0])


def starts_of_all(wire: Array, begins: Array, data: Array) -> Array:
    """Return from which values the CRC of each payload ends as `wire` (integers, as many): the CRC run backwards.

    Payloads lie one behind the other; `begins` has one entry more than there are.
    """
    return cells(crc_starts((wire, begins, data)), np.int64)


def may_be_mistaken(types: Types, code: Array, wire: Array, begins: Array, data: Array) -> Array:
    """Return a mask of the wrong CRCs that a mistake may give: of others `wrong_crc` and `formulas` find none.

    Args:
        types: the definitions.
        code: the type of each.
        wire: the CRCs as received.
        begins: where the payload of each begins in `data`, one entry more.
        data: all payloads.
    """
    codes, which = np.unique(code, return_inverse=True)
    starts = [
        (types.starts(one), _mistaken_starts(tuple(types.signatures(one)), tuple(types.mistaken(one))))
        for one in codes.tolist()
    ]
    return cells(mistaken(starts, which, (wire, begins, data)), np.uint8).view(bool)


@lru_cache(maxsize=1024)
def _mistaken_starts(signatures: tuple[int, ...], others: tuple[int, ...]) -> Sequence[int]:
    """Return the values from which the CRC of a type starts by mistake."""
    return [CRC_BEGIN, *(way.start for way in _ways(signatures) if not way.xor), *map(crc_start, others)]
