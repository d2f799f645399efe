"""The definitions that an MCAP file on disk repeats at its end, for when those in its data are lost."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mcap.opcode import Opcode

from analyzer.sources.mcap.records import HEAD, MAGIC, PREFIX, definitions

if TYPE_CHECKING:
    from pathlib import Path

    from mcap.records import Channel, Schema

_FOOTER = 20
# No summary that is read is larger.
_LARGEST = 1 << 26


def read(path: Path) -> list[Schema | Channel]:
    """Schemas and channels, none if the end of the file is not as it should be."""
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
            return list(definitions(file.read()))
    except OSError:
        return []
