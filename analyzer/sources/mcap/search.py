"""The search for the next record behind damage, in short rounds."""

from __future__ import annotations

import re
from enum import Enum
from typing import TYPE_CHECKING, NamedTuple

from mcap.opcode import Opcode

from analyzer.sources.mcap.records import FITS, HEAD, MESSAGE_HEADER, PREFIX, SMALL, fit

if TYPE_CHECKING:
    from collections.abc import Collection

# Where a record may begin: a known opcode, a length below the limit.
_BEGIN = re.compile(rb"(?=[\x02-\x0f].{3}[\0-\x10]\0{4})", re.DOTALL)
# Messages in a row that can be trusted.
_CHAIN = 4
# One round looks at so many bytes, and at so many places where a record may begin.
ROUND, PLACES = 1 << 20, 1 << 12


class Result(Enum):
    """The result of a round: a record; nothing yet; nothing before more bytes are there."""

    FOUND = 1
    ONWARD = 2
    NOTHING = 3


class Found(NamedTuple):
    """Where the record stands, or where to go on. `places` were looked at."""

    at: int
    result: Result
    places: int


def find(data: bytes, start: int, channels: Collection[int], *, final: bool) -> Found:
    """One round of the search for the first record from `start` on that can be trusted.

    Everything that fits its length to the byte can be trusted; messages only in a chain, and of known channels.
    """
    end, places = min(len(data), start + ROUND), 0
    for match in _BEGIN.finditer(data, start, end + PREFIX - 1):
        at = match.start()
        places += 1
        sound = _chain(data, at, channels, final=final)
        if sound:
            return Found(at, Result.FOUND, places)
        if sound is None and len(data) - at <= SMALL:
            return Found(at, Result.NOTHING, places)
        if places == PLACES:
            return Found(at + 1, Result.ONWARD, places)
    if end < len(data):
        return Found(end, Result.ONWARD, places)
    return Found(max(start, len(data) - (0 if final else PREFIX - 1)), Result.NOTHING, places)


def _chain(data: bytes, at: int, channels: Collection[int], *, final: bool) -> bool | None:
    missing = False if final else None
    for _ in range(_CHAIN):
        if len(data) - at < PREFIX + 2:
            return True if final and at == len(data) else missing
        opcode, length = HEAD.unpack_from(data, at)
        if opcode != Opcode.MESSAGE:
            found = fit(data, at)
            if found > 0:
                return missing
            there = not final or opcode == Opcode.CHUNK or at + PREFIX + length <= len(data)
            return there and found == FITS and opcode != Opcode.HEADER
        known = int.from_bytes(data[at + PREFIX : at + PREFIX + 2], "little") in channels
        if not known or not MESSAGE_HEADER <= length <= SMALL:
            return False
        at += PREFIX + length
        if at > len(data):
            return missing
    return True
