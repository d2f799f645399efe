"""What an MCAP file says of itself at its end: its definitions once more, and how much it holds."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, NamedTuple

from mcap.opcode import Opcode

from analyzer.sources.mcap.records import HEAD, MAGIC, PREFIX, definitions

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from mcap.records import Channel, Schema

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
    """Reads the body of a statistics record, whose fields are there."""
    messages, _, _, _, _, chunks = _STATISTICS.unpack_from(data, at)
    return Counts(messages, chunks)


def read(path: Path, goes_on: Callable[[], bool]) -> list[Schema | Channel]:
    """Schemas and channels as long as `goes_on` says so, none if the end of the file is not as it should be."""
    try:
        with path.open("rb") as file:
            size = file.seek(0, 2)
            file.seek(max(0, size - PREFIX - _FOOTER - len(MAGIC)))
            tail = file.read()
            if len(tail) < PREFIX + 8 or HEAD.unpack_from(tail) != (Opcode.FOOTER, _FOOTER) or not tail.endswith(MAGIC):
                return []
            start = int.from_bytes(tail[PREFIX : PREFIX + 8], "little")
            if not max(len(MAGIC), size - _LARGEST) <= start < size:
                return []
            file.seek(start)
            return list(definitions(file.read(), goes_on))
    except OSError:
        return []
