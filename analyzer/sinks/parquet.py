"""Parquet files: zstd, one row group a call; each column is stored as what its values are like needs it."""

from __future__ import annotations

from typing import TYPE_CHECKING, BinaryIO

import pyarrow as pa
import pyarrow.parquet as pq

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

SUFFIX = ".parquet"
# How columns are stored whose values hardly ever come twice: no dictionary is tried.
_GROWING, _RANDOM = ("t", "t_end", "frame", "frames", "line", "transfer"), ("crc_wire", "crc_here")
_BYTES = ("data", "payload")
_STORED = dict.fromkeys(_GROWING + _RANDOM, "DELTA_BINARY_PACKED") | dict.fromkeys(_BYTES, "DELTA_LENGTH_BYTE_ARRAY")


class ParquetFile:
    """One table. `close` adds what is only known at the end to the metadata of the file."""

    def __init__(self, file: BinaryIO, schema: pa.Schema) -> None:
        leaves = [(name, path) for name, field in zip(schema.names, schema, strict=True) for path in _leaves(field)]
        stored = {path: _STORED[name] for name, path in leaves if _fits(schema.field(name).type, _STORED.get(name))}
        self._writer = pq.ParquetWriter(
            file, schema, compression="zstd", use_dictionary=[path for _, path in leaves if path not in stored],
            column_encoding=stored,
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


def _fits(kind: pa.DataType, encoding: str | None) -> bool:
    """Return whether a column can be stored so: a field of a message may be called like one of those."""
    value = kind.value_type if pa.types.is_list(kind) else kind
    if encoding == _STORED["data"]:
        return bool(pa.types.is_binary(value))
    return encoding is not None and (pa.types.is_integer(value) or pa.types.is_timestamp(value))


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
