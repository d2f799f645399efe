"""Rows of a table that wait on the disk until the capture has ended."""

from __future__ import annotations

import tempfile
from typing import TYPE_CHECKING

import pyarrow as pa

from analyzer.sinks.atomic import TargetError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from typing import IO

_IN_MEMORY = 1 << 22


class Spool:
    """Takes batches of one schema and gives them back in the same order, from a nameless temporary file.

    Args:
        schema: of the batches.
        folder: where the temporary file is made; None is where the system has them.
    """

    def __init__(self, schema: pa.Schema, folder: str | None) -> None:
        self._file: IO[bytes] = tempfile.SpooledTemporaryFile(_IN_MEMORY, dir=folder)  # noqa: SIM115 - see close
        self._label = "temporary file" + (f" in {folder}" if folder else "")
        self._writer = pa.ipc.new_stream(self._file, schema, options=pa.ipc.IpcWriteOptions(compression="lz4"))

    def feed(self, rows: pa.RecordBatch) -> None:
        """Take rows. Raises `TargetError` when there is no room."""
        try:
            self._writer.write_batch(rows)
        except OSError as error:
            raise TargetError(self._label, error) from None

    def replay(self) -> Iterator[pa.RecordBatch]:
        """Give the rows once more; no more can be taken from then on. Raises `TargetError`."""
        try:
            self._writer.close()
            self._file.seek(0)
        except OSError as error:
            raise TargetError(self._label, error) from None
        yield from pa.ipc.open_stream(self._file)

    def close(self) -> None:
        """Give the room back."""
        self._file.close()
