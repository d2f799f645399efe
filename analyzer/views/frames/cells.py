"""Rows of frames for the native renderer: columns beside those of the table, and texts row by row."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from analyzer import _native
from analyzer.tables import EXTENDED, REMOTE, VERDICTS
from analyzer.views.frames.rows import ERROR_FRAME
from analyzer.views.members import PLAIN
from analyzer.views.sheets import PIECE, SheetColumns, flat
from dissectors.kit.cells import numbers

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from analyzer.decode.engine import Batch
    from analyzer.views.frames.rows import FrameRows, ListedFrames
    from analyzer.views.members import Take
    from analyzer.views.sheets import Template
    from analyzer.window.listed import ListedRows

VERDICT_WORDS = (*VERDICTS, "error frame")
_LENGTH_CODE = 8  # lowest bit of it in the flags
_WIDE, _NARROW = 8, 3  # digits of an identifier


class FrameSheet:
    """Writes rows of frames by a template.

    It reads the columns of `ListedFrames`, those that are given with each table, and, as numbers, `digits` (of the
    identifier, 0 for an error frame), `length` (of a remote frame its length code), `remote` and `error`.
    """

    def __init__(self, make: Callable[[SheetColumns], Template]) -> None:
        self._columns = SheetColumns(pa.schema([]), "verdict")
        self._template = _native.Template([make(self._columns)])

    def texts(
        self, table: ListedFrames, beside: Mapping[str, pa.Array], words: Sequence[Sequence[str]]
    ) -> Iterator[str]:
        """Yield the text of each row. `words` are the lists that the template takes words from."""
        own = zip(table.rows.schema.names, table.rows.columns, strict=True)
        known = {**dict(own), **_measured(table.rows), **beside}
        columns = [flat(known[name]) for name in self._columns.names]
        rows = np.arange(len(table.rows), dtype=np.uint32)
        sheet = _native.Sheet(self._template, columns, [], [list(some) for some in words], 0, rows)
        for start in range(0, len(rows), PIECE):
            yield from sheet.texts(start, start + PIECE)


class FrameWriter(ABC):
    """A view of frames: those that are known for good batch by batch, at the end those that still waited."""

    def __init__(self, rows: FrameRows) -> None:
        self.waited = 0  # rows that stood at the end
        self._rows = rows

    def begin(self) -> str:
        """Write what stands before the first frame: nothing."""
        return ""

    def rows(self, batch: Batch, picked: ListedRows) -> Iterator[str]:
        """Write each frame that is known for good."""
        for table in self._rows.feed(batch, picked):
            yield from self._texts(table)

    def end(self) -> str:
        """Write the frames that still waited."""
        texts = [text for table in self._rows.finish() for text in self._texts(table)]
        self.waited = len(texts)
        return "".join(texts)

    @abstractmethod
    def _texts(self, table: ListedFrames) -> Iterator[str]:
        """Write the rows of a table."""


def identifier(columns: SheetColumns, missing: str = "") -> Template:
    """Return the template of an identifier: 8 digits if it is extended, 3 if not."""
    shown = [
        (digits, columns.of("id", ("number", PLAIN, ("format", "", "-", True, digits, None, "X"))))
        for digits in (_NARROW, _WIDE)
    ]
    return ("by", columns.place("digits"), shown, ("text", missing))


def bit_of(bit: int) -> Take:
    """Return how a bit is taken from a word, as 0 or 1."""
    return None, (bit.bit_length() - 1, 1), None, False


def _measured(rows: pa.RecordBatch) -> dict[str, pa.Array]:
    flags, data = numbers(rows.column("flags")), rows.column("data")
    error = numbers(rows.column("verdict")) == ERROR_FRAME
    remote = flags & REMOTE != 0
    ends = np.frombuffer(data.buffers()[1], np.int32)[data.offset : data.offset + len(data) + 1]
    length = np.where(remote, flags >> _LENGTH_CODE & 0xF, np.diff(ends))
    digits = np.where(error, 0, np.where(flags & EXTENDED != 0, _WIDE, _NARROW))
    columns = {"digits": digits, "length": length, "remote": remote, "error": error}
    return {name: pa.array(column.astype(np.uint8)) for name, column in columns.items()}
