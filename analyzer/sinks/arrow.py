"""Arrow IPC files ("Feather V2"), buffers packed with zstd."""

from __future__ import annotations

from typing import TYPE_CHECKING, BinaryIO

import pyarrow as pa

if TYPE_CHECKING:
    from collections.abc import Mapping

SUFFIX = ".arrow"
# The format writes a dictionary once, so texts that are not known beforehand are written out.
_OPEN_ENDED = ("bus", "type", "anomaly")


class ArrowFile:
    """One table."""

    def __init__(self, file: BinaryIO, schema: pa.Schema, about: Mapping[str, str]) -> None:
        fields = [_plain(field) for field in schema]
        self._schema = pa.schema(fields, metadata={**(schema.metadata or {}), **about})
        options = pa.ipc.IpcWriteOptions(compression="zstd")
        self._writer = pa.ipc.new_file(file, self._schema, options=options)

    def write(self, table: pa.Table) -> None:
        """Write a record batch."""
        self._writer.write_table(table.cast(self._schema).combine_chunks())

    def close(self, _: Mapping[str, str]) -> None:
        """Write the footer."""
        self._writer.close()


def _plain(field: pa.Field) -> pa.Field:
    return field.with_type(pa.string()) if field.name in _OPEN_ENDED and pa.types.is_dictionary(field.type) else field
