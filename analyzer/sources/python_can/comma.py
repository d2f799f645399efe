"""The CSV that python-can writes: one message a line, its data in base 64."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from can.io.csv import CSVReader

from analyzer.sources.can_rows import (
    ABSOLUTE,
    BUS_ERROR,
    FROM_START,
    MICROSECONDS,
    NANOSECONDS,
    Unreadable,
    significant,
    store,
    store_error,
)
from analyzer.sources.python_can import lines
from analyzer.sources.python_can.lines import Sort
from analyzer.sources.python_can.messages import nanoseconds
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from can import Message

    from analyzer._native import FrameBatch, Rows
    from analyzer.sources import Source

_NAMES = "timestamp,arbitration_id,extended,remote,error,dlc,data"
_ROW = re.compile(r"([-+.e\d]+),0x[0-9a-f]+,[01],[01],[01],\d{1,2},[A-Za-z0-9+/]*={0,2}", re.ASCII)
# No clock was set to 1973: smaller times count from a start.
_RELATIVE_BELOW = 100_000_000 * SECOND


def read(source: Source, chunks: Iterator[bytes]) -> Iterator[bytes | FrameBatch]:
    """Return the batches of a CSV capture."""
    source.notes.append("CSV keeps no bus (all is can0), no direction, no CAN FD flags (more than 8 bytes are CAN FD)")
    yield from lines.read(_Csv(), chunks)


class _Csv:
    """`Grammar` of this CSV."""

    header: tuple[str, ...] = (_NAMES,)

    def reader(self, file: lines.NumberedText) -> Iterable[Message]:
        return CSVReader(file)  # type: ignore[arg-type]  # iterating is all it does

    def sort(self, line: str) -> tuple[Sort, int]:
        if not line:
            return Sort.BLANK, 0
        if line == _NAMES:
            return Sort.COMMENT, 0
        row = _ROW.fullmatch(line)
        if row is None:
            raise Unreadable("not a row of python-can's CSV")
        return Sort.MESSAGE, significant(nanoseconds(row[1]))

    def store(self, rows: Rows, _: str, message: Message, t: int) -> None:
        rows.stamp((FROM_START if abs(t) < _RELATIVE_BELOW else ABSOLUTE) | (NANOSECONDS if t % 1000 else MICROSECONDS))
        if message.is_error_frame:
            # The class bits as SocketCAN gave them, if it was SocketCAN.
            store_error(rows, t, "can0", message.arbitration_id or BUS_ERROR, bytes(message.data))
            return
        size = message.dlc
        message.is_fd = size > 8
        code = min(size, 8) if message.is_fd else size
        store(rows, message, t, "can0", code=code, size=size, directed=False)
