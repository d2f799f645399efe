"""Decoded tables as files, one a table: rows are gathered into large row groups, in bounded memory."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, BinaryIO, Protocol

import pyarrow as pa

from analyzer.sinks import arrow, csv, parquet
from analyzer.sinks.arrow import ArrowFile
from analyzer.sinks.behind import Behind
from analyzer.sinks.csv import CsvFile
from analyzer.sinks.parquet import ParquetFile

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

SUFFIXES = {"parquet": parquet.SUFFIX, "arrow": arrow.SUFFIX, "csv": csv.SUFFIX}
# A table is written once it has gathered so many rows, the largest one once all together take so many bytes.
ROW_GROUP = 1 << 18
GATHERED = 1 << 25


class TableFile(Protocol):
    """A file that takes one table."""

    def write(self, table: pa.Table) -> None:
        """Write rows, as one row group if the format knows such."""

    def close(self, about: Mapping[str, str]) -> None:
        """End the format; the file stays open. `about` is what is known of the capture at its end."""


class Tables:
    """Files of one format, made when their table first has rows.

    Args:
        form: a key of `SUFFIXES`.
        make: makes the file of a table.
        about: what is known of the capture beforehand, for the metadata of the files.
        threaded: encode in threads of its own what has gathered.
    """

    def __init__(self, form: str, make: Callable[[str], BinaryIO], about: Mapping[str, str], *, threaded: bool) -> None:
        self._form, self._make, self._about = form, make, about
        self._writing = Behind(threaded=threaded)
        self._files: dict[str, TableFile] = {}
        self._waiting: dict[str, list[pa.RecordBatch]] = {}
        self._bytes: dict[str, int] = {}
        self._rows: dict[str, int] = {}

    def feed(self, name: str, rows: pa.RecordBatch) -> None:
        """Take rows of a table; the first ones, possibly none, give it its columns."""
        if name not in self._files:
            self._files[name] = self._open(self._make(name), rows.schema)
            self._waiting[name], self._bytes[name], self._rows[name] = [], 0, 0
        if not len(rows):
            return
        self._waiting[name].append(rows)
        self._bytes[name] += rows.nbytes
        self._rows[name] += len(rows)
        if sum(map(len, self._waiting[name])) >= ROW_GROUP:
            self._write(name)
        while sum(self._bytes.values()) > GATHERED:
            self._write(max(self._bytes, key=self._bytes.__getitem__))

    def close(self, about: Mapping[str, str]) -> None:
        """Write what has gathered and end every file; `about` is known only now."""
        for name in self._files:
            self._write(name)
        self._writing.finish()
        for file in self._files.values():
            file.close({**self._about, **about})

    def abandon(self) -> None:
        """Leave unfinished files as they are."""
        self._writing.close()
        for file in self._files.values():
            if isinstance(file, ParquetFile):
                file.abandon()

    @property
    def rows(self) -> dict[str, int]:
        """The tables there are, and how many rows each has got."""
        return dict(self._rows)

    def _write(self, name: str) -> None:
        if self._waiting[name]:
            self._writing.do(name, partial(_write, self._files[name], self._waiting[name]))
        self._waiting[name], self._bytes[name] = [], 0

    def _open(self, file: BinaryIO, schema: pa.Schema) -> TableFile:
        if self._form == "parquet":
            return ParquetFile(file, schema)
        if self._form == "arrow":
            return ArrowFile(file, schema, self._about)
        return CsvFile(file, schema)


def _write(file: TableFile, batches: list[pa.RecordBatch]) -> None:
    file.write(pa.Table.from_batches(batches).unify_dictionaries())
