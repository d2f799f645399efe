"""An MCAP file in its own words at its end: its definitions once more, and how much it holds."""

from __future__ import annotations

import struct
from contextlib import closing
from typing import TYPE_CHECKING, NamedTuple

from mcap.opcode import Opcode

from analyzer.sources.errors import CaptureError
from analyzer.sources.mcap.records import HEAD, MAGIC, MORE, PREFIX, definitions
from analyzer.sources.stored import CHUNK

if TYPE_CHECKING:
    from collections.abc import Callable

    from mcap.records import Channel, Schema

    from analyzer.sources.origin import Opened
    from analyzer.sources.stored import Stored

_FOOTER = 20
# No summary that is read is larger.
_LARGEST = 1 << 26
_STATISTICS = struct.Struct("<QHIIII")


class Counts(NamedTuple):
    """How many messages and chunks there are."""

    messages: int
    chunks: int

    def differs(self, found: Counts) -> str:
        """In words how much of it was found, empty if that is all."""
        for what, stated, there in zip(self._fields, self, found, strict=True):
            if stated != there:
                return f"the file counts {stated} {what}, {there} were found"
        return ""


def counts(data: bytes, at: int) -> Counts:
    """Read the body of a statistics record, whose fields are there."""
    messages, _, _, _, _, chunks = _STATISTICS.unpack_from(data, at)
    return Counts(messages, chunks)


def read(source: Stored, goes_on: Callable[[], bool]) -> list[Schema | Channel]:
    """Return schemas and channels as long as `goes_on` says so, none if the end of the file is not as it should be."""
    try:
        with closing(source.opened()) as file:
            size = file.seek(0, 2)
            tail = _rest(file, max(0, size - PREFIX - _FOOTER - MORE - len(MAGIC)))
            start = _start(tail)
            if not max(len(MAGIC), size - _LARGEST) <= start < size:
                return []
            return list(definitions(_rest(file, start), goes_on))
    except (OSError, CaptureError):
        return []


def _start(tail: bytes) -> int:
    """Return where the summary begins: in the last footer whose length reaches to the end mark, 0 if there is none."""
    end = len(tail) - len(MAGIC)
    at = end - PREFIX - _FOOTER + 1
    while tail.endswith(MAGIC) and (at := tail.rfind(Opcode.FOOTER, 0, max(at, 0))) >= 0:
        if HEAD.unpack_from(tail, at)[1] == end - at - PREFIX:
            return int.from_bytes(tail[at + PREFIX : at + PREFIX + 8], "little")
    return 0


def _rest(file: Opened, start: int) -> bytes:
    file.seek(start)
    return b"".join(iter(lambda: file.read(CHUNK) or b"", b""))
