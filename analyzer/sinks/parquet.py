"""Parquet files: zstd, one row group a call, numbers that grow stored as differences."""

from __future__ import annotations

from typing import TYPE_CHECKING, BinaryIO

import pyarrow as pa
import pyarrow.parquet as pq

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

SUFFIX = ".parquet"
_GROWING = ("t", "t_end", "frame", "frames", "line", "transfer")
_DIFFERENCES = "DELTA_BINARY_PACKED"


class ParquetFile:
    """One table. `close` adds what is only known at the end to the metadata of the file."""

    def __init__(self, file: BinaryIO, schema: pa.Schema) -> None:
        leaves = [(name, path) for name, field in zip(schema.names, schema, strict=True) for path in _leaves(field)]
        growing = [path for name, path in leaves if name in _GROWING]
        self._writer = pq.ParquetWriter(
            file, schema, compression="zstd", use_dictionary=[path for _, path in leaves if path not in growing],
            column_encoding=dict.fromkeys(growing, _DIFFERENCES),
        )  # fmt: skip

    def write(self, table: pa.Table) -> None:
        """Write a row group."""
        self._writer.write_table(table, row_group_size=max(len(table), 1))

    def abandon(self) -> None:
        """Let nothing more be written, not even by the writer's own clean-up."""
        self._writer.is_open = False

    def close(self, about: Mapping[str, str]) -> None:
        """Write the footer."""
        self._writer.add_key_value_metadata(dict(about))
        self._writer.close()


def _leaves(field: pa.Field, path: str = "") -> Iterator[str]:
    """Give the names Parquet gives to the columns that a field is stored in."""
    kind, path = field.type, f"{path}{field.name}"
    if pa.types.is_list(kind):
        yield from _leaves(pa.field("element", kind.value_type), f"{path}.list.")
    elif pa.types.is_struct(kind):
        for k in range(kind.num_fields):
            yield from _leaves(kind.field(k), f"{path}.")
    else:
        yield path
