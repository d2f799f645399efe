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
_MORE = 64
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
    shape = _SHAPES.get(opcode)
    if shape is None:
        return LONGER if opcode and length <= LIMIT else BROKEN
    size = 0
    for part in shape:
        if part > 0:
            size += part
            continue
        form = _U32 if part == _DATA4 else _U64
        if size + form.size > length:
            return BROKEN
        if at + PREFIX + size + form.size > len(data):
            return PREFIX + size + form.size
        size += form.size + form.unpack_from(data, at + PREFIX + size)[0]
    return FITS if size == length else LONGER if size < length <= size + _MORE else BROKEN


def whole(data: bytes, at: int) -> int | None:
    """Where the record at `at` ends, if it is sound and all there."""
    if len(data) - at < PREFIX:
        return None
    end = at + PREFIX + HEAD.unpack_from(data, at)[1]
    return end if end <= len(data) and fit(data, at) in {FITS, LONGER} else None


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
