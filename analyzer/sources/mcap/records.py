"""Records of an MCAP file: what they must look like from outside, and the few that are read."""

from __future__ import annotations

import struct
from io import BytesIO
from typing import TYPE_CHECKING

from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile, McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Schema

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

MAGIC = b"\x89MCAP0\r\n"
# Opcode and length in front of each record.
PREFIX = 9
# Channel, sequence, log time and publish time of a message.
MESSAGE_HEADER = 22
# A record that is kept in memory is never longer.
LIMIT = 1 << 28
# Nor is a definition, or a message in a chain that is searched for.
SMALL = 1 << 24
# Bytes that later versions may have added to a record.
MORE = 1 << 16
# Records in a row behind a longer one that can be trusted.
_ROW = 4
HEAD = struct.Struct("<BQ")
DEFINITIONS = frozenset({Opcode.SCHEMA, Opcode.CHANNEL})
_U32, _U64 = struct.Struct("<I"), struct.Struct("<Q")

# How a record fits its length: exactly, with bytes behind the fields that are known (or not known at all), or not.
FITS, LONGER, BROKEN = -1, -2, -3

# Fields by opcode: bytes of a fixed size, data behind its 4 or 8 byte length.
_DATA4, _DATA8 = 0, -1
_SHAPES: dict[int, tuple[int, ...]] = {
    Opcode.HEADER: (_DATA4, _DATA4),
    Opcode.FOOTER: (20,),
    Opcode.SCHEMA: (2, _DATA4, _DATA4, _DATA4),
    Opcode.CHANNEL: (4, _DATA4, _DATA4, _DATA4),
    Opcode.CHUNK: (28, _DATA4, _DATA8),
    Opcode.MESSAGE_INDEX: (2, _DATA4),
    Opcode.CHUNK_INDEX: (32, _DATA4, 8, _DATA4, 16),
    Opcode.ATTACHMENT: (16, _DATA4, _DATA4, _DATA8, 4),
    Opcode.ATTACHMENT_INDEX: (40, _DATA4, _DATA4),
    Opcode.STATISTICS: (42, _DATA4),
    Opcode.METADATA: (_DATA4, _DATA4),
    Opcode.METADATA_INDEX: (16, _DATA4),
    Opcode.SUMMARY_OFFSET: (17,),
    Opcode.DATA_END: (4,),
}


def fit(data: bytes, at: int) -> int:
    """How the record at `at` (its opcode and length are there) fits; else how many of its bytes are needed to know."""
    opcode, length = HEAD.unpack_from(data, at)
    if opcode == Opcode.MESSAGE:
        return FITS if MESSAGE_HEADER <= length <= LIMIT else BROKEN
    if opcode in DEFINITIONS and length > SMALL:
        return BROKEN
    if opcode not in _SHAPES:
        return LONGER if opcode and length <= LIMIT else BROKEN
    size, there = _known(data, at, length)
    if not there:
        return size
    return FITS if size == length else LONGER if 0 <= size < length <= size + MORE else BROKEN


def _known(data: bytes, at: int, length: int) -> tuple[int, bool]:
    """Return how many bytes the known fields of a record have, -1 if more than its length, and that it is sure.

    Else return how many bytes of the record are needed to know.
    """
    size = 0
    for part in _SHAPES[data[at]]:
        if part > 0:
            size += part
            continue
        form = _U32 if part == _DATA4 else _U64
        if size + form.size > length:
            return -1, True
        if at + PREFIX + size + form.size > len(data):
            return PREFIX + size + form.size, False
        size += form.size + form.unpack_from(data, at + PREFIX + size)[0]
    return (size if size <= length else -1), True


def goes_on(data: bytes, at: int, *, final: bool) -> bool | None:
    """Return whether the record at `at`, longer than its fields, ends where others begin; None: more bytes are needed.

    One that stands right behind the known fields shows that the length is wrong.
    """
    opcode, length = HEAD.unpack_from(data, at)
    if opcode not in _SHAPES:
        return _followed(data, at, final=final)
    if length > SMALL:  # is not kept to look behind it
        return True
    followed = _followed(data, at, final=final)
    if not followed:
        return followed
    behind = at + PREFIX + _known(data, at, length)[0]
    found = fit(data, behind) if behind + PREFIX <= len(data) else BROKEN
    return None if found > 0 and not final else found != FITS


def _followed(data: bytes, at: int, *, final: bool) -> bool | None:
    """Return whether others follow: as many as can be trusted, or up to one that fits its length exactly."""
    for _ in range(_ROW):
        opcode, length = HEAD.unpack_from(data, at)
        at += PREFIX + length
        mark = opcode == Opcode.FOOTER
        if len(data) - at < (len(MAGIC) if mark else PREFIX):  # where the file is cut nothing is known
            return (opcode in _SHAPES or at == len(data)) if final else None
        if mark:
            return data.startswith(MAGIC, at)
        found = fit(data, at)
        if found > 0:
            return True if final else None
        if found != LONGER:
            return found == FITS
    return True


def whole(data: bytes, at: int) -> int | None:
    """Where the record at `at` ends, if it is sound and all there."""
    if len(data) - at < PREFIX:
        return None
    end = at + PREFIX + HEAD.unpack_from(data, at)[1]
    found = fit(data, at) if end <= len(data) else BROKEN
    return end if found == FITS or (found == LONGER and goes_on(data, at, final=True)) else None


class _Whole(ReadDataStream):
    """Reads nothing by halves."""

    def __init__(self, data: bytes) -> None:
        super().__init__(BytesIO(data))
        self._left = len(data)

    def read(self, length: int) -> bytes:
        self._left -= length
        if self._left < 0:
            raise EndOfFile
        return super().read(length)


def definition(opcode: int, body: bytes) -> Schema | Channel | None:
    """Return a schema or a channel, None if the record is damaged."""
    kind = Schema if opcode == Opcode.SCHEMA else Channel
    try:
        found: Schema | Channel = kind.read(_Whole(body))
    except (McapError, ValueError):
        return None
    return found


def definitions(data: bytes, goes_on: Callable[[], bool]) -> Iterator[Schema | Channel]:
    """All schemas and channels up to the first record that does not fit; `goes_on` is asked in front of each record."""
    at = 0
    while goes_on() and (end := whole(data, at)) is not None:
        if data[at] in DEFINITIONS and (found := definition(data[at], data[at + PREFIX : end])) is not None:
            yield found
        at = end
