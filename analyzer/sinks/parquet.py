"""Parquet files: zstd, one row group a call; each column is stored as what its values are like needs it.

Readers that look for a part of a file skip row groups by the bounds of what grows; of other columns each row group has
nearly all values, so no bounds are kept of them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, BinaryIO

import pyarrow as pa
import pyarrow.parquet as pq

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

SUFFIX = ".parquet"
# Values that hardly ever come twice: no dictionary is tried. Of growing ones a row group tells the bounds.
_GROWING, _RANDOM = ("t", "t_end", "frame", "frames", "line", "transfer"), ("crc_wire", "crc_here")
# Few values, which zstd finds as well as a dictionary would, and sooner.
_FEW = ("flags", "type_id", "variant", "src", "dst", "priority", "transfer_id", "step", "bits_left", "layout")
_NUMBERS = dict.fromkeys(_GROWING + _RANDOM, "DELTA_BINARY_PACKED") | dict.fromkeys(_FEW, "PLAIN")
_BYTES = {"data": "DELTA_LENGTH_BYTE_ARRAY", "payload": "PLAIN"}


class ParquetFile:
    """One table. `close` adds what is only known at the end to the metadata of the file."""

    def __init__(self, file: BinaryIO, schema: pa.Schema) -> None:
        leaves = [(name, path) for name, field in zip(schema.names, schema, strict=True) for path in _leaves(field)]
        stored = {path: way for name, path in leaves if (way := _encoding(name, schema.field(name).type))}
        self._writer = pq.ParquetWriter(
            file, schema, compression="zstd", use_dictionary=[path for _, path in leaves if path not in stored],
            column_encoding=stored, write_statistics=[path for name, path in leaves if name in _GROWING],
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


def _encoding(name: str, kind: pa.DataType) -> str | None:
    """Return how a column is stored if not by a dictionary: a field of a message may be called like one of those."""
    value = kind.value_type if pa.types.is_list(kind) else kind
    if pa.types.is_binary(value):
        return _BYTES.get(name)
    return _NUMBERS.get(name) if pa.types.is_integer(value) or pa.types.is_timestamp(value) else None


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
