"""Rows of a table as Protocol Buffers messages: Arrow columns in, bytes out, encoded natively."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from analyzer import _native
from analyzer.sinks.telemetry_schema import as_bytes

if TYPE_CHECKING:
    from collections.abc import Sequence

    Spec = tuple[int, str, bytes | None, bytes, bytes, list["Spec"]]


def encode(table: pa.RecordBatch, columns: Sequence[str]) -> tuple[bytes, bytes]:
    """Encode a message a row, with `columns` as its fields 1, 2, ...; and the u64 ends of the messages."""
    specs = [_spec(k, table.schema.field(name), table.column(name)) for k, name in enumerate(columns, 1)]
    data, ends = _native.protobuf(len(table), specs)
    return ends, data


def _spec(number: int, field: pa.Field, array: pa.Array) -> Spec:
    if pa.types.is_dictionary(array.type):
        array = array.cast(array.type.value_type)
    if array.offset:
        array = array.take(pa.array(np.arange(len(array))))
    kind, rows = array.type, len(array)
    valid = array.buffers()[0].to_pybytes() if array.null_count else None
    if pa.types.is_struct(kind):
        inner = [_spec(k, kind.field(k - 1), array.field(k - 1)) for k in range(1, kind.num_fields + 1)]
        return number, "message", valid, b"", b"", inner
    if pa.types.is_boolean(kind):
        return number, "bool", valid, _bytes(array.buffers()[1], (rows + 7) // 8), b"", []
    if pa.types.is_string(kind) or pa.types.is_binary(kind):
        _, offsets, data = array.buffers()
        return number, "bytes", valid, _bytes(data), _offsets(offsets, rows), []
    if not pa.types.is_list(kind):
        return number, str(kind), valid, _bytes(array.buffers()[1], rows * kind.bit_width // 8), b"", []
    offsets, inside = array.buffers()[1], array.values
    if as_bytes(field):
        return number, "bytes", valid, _bytes(inside.buffers()[1], len(inside)), _offsets(offsets, rows), []
    if pa.types.is_floating(inside.type) and inside.null_count:  # a list has no room for "no value"
        inside = pc.fill_null(inside, pa.scalar(float("nan"), inside.type))
    return number, "list", valid, b"", _offsets(offsets, rows), [_spec(1, kind.value_field, inside)]


def _offsets(buffer: pa.Buffer | None, rows: int) -> bytes:
    return _bytes(buffer, 4 * (rows + 1)) or bytes(4)


def _bytes(buffer: pa.Buffer | None, size: int | None = None) -> bytes:
    if buffer is None:
        return b""
    return bytes(buffer.to_pybytes() if size is None or size == buffer.size else buffer.slice(0, size).to_pybytes())
