"""CSV files (RFC 4180) for spreadsheets and scripts.

A time is two columns: `<name>_ns`, exact, and `<name>` to read (UTC); a field that has that name already becomes
`<name>_ns.field`. Bytes are hexadecimal, lists and structures JSON.
Text that a spreadsheet would take for a formula gets an apostrophe in front.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv

from analyzer.facts.json_number import number

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

SUFFIX = ".csv"
_AT_ONCE = 1 << 14
_FORMULA = r"^[=+\-@\t\r\n]"
_SPECIAL = {"nan": '"NaN"', "inf": '"Infinity"', "-inf": '"-Infinity"'}


class CsvFile:
    """One table."""

    def __init__(self, file: BinaryIO, schema: pa.Schema) -> None:
        empty = pa.Table.from_batches([], schema)
        self._writer = pyarrow.csv.CSVWriter(file, _flat(empty).schema)

    def write(self, table: pa.Table) -> None:
        """Write lines, some at a time: they are several times larger than the table."""
        for start in range(0, len(table), _AT_ONCE):
            rows = pa.array(np.arange(start, min(start + _AT_ONCE, len(table))))
            self._writer.write_table(_flat(table.take(rows)))

    def close(self, _: Mapping[str, str]) -> None:
        """Write what is left."""
        self._writer.close()


def _flat(table: pa.Table) -> pa.Table:
    columns: dict[str, pa.ChunkedArray] = {}
    for field, chunked in zip(table.schema, table.columns, strict=True):
        for name, cells in _cells(field, chunked):
            columns[f"{name}.field" if name in columns else name] = cells
    return pa.Table.from_arrays(list(columns.values()), names=list(columns))


def _cells(field: pa.Field, chunked: pa.ChunkedArray) -> Iterator[tuple[str, pa.ChunkedArray]]:
    name, kind = field.name, field.type
    if pa.types.is_timestamp(kind):
        yield f"{name}_ns", chunked.cast(pa.int64())
        yield name, chunked
    elif pa.types.is_duration(kind):
        yield f"{name}_ns", chunked.cast(pa.int64())
    else:
        text = _text_of(kind)
        yield name, chunked if text is None else pa.chunked_array([text(a) for a in chunked.chunks], pa.string())


def _text_of(kind: pa.DataType) -> Any:
    if pa.types.is_dictionary(kind):
        return lambda array: _harmless(array.cast(pa.string()))
    if pa.types.is_string(kind):
        return _harmless
    if pa.types.is_binary(kind):
        return _hexadecimal
    if pa.types.is_list(kind) and _is_number(kind.value_type):
        return _numbers
    return _json if pa.types.is_nested(kind) else None


def _is_number(kind: pa.DataType) -> bool:
    return bool(pa.types.is_integer(kind) or pa.types.is_floating(kind))


def _harmless(texts: pa.Array) -> pa.Array:
    risky = pc.fill_null(pc.match_substring_regex(texts, _FORMULA), False)
    return pc.if_else(risky, pc.binary_join_element_wise("'", texts, ""), texts) if pc.any(risky).as_py() else texts


def _hexadecimal(array: pa.Array) -> pa.Array:
    """Write two digits a byte, all cells in one go."""
    valid, offsets, data = array.buffers()
    ends = np.frombuffer(offsets, np.int32)[array.offset : array.offset + len(array) + 1]
    digits = b"" if data is None else memoryview(data)[ends[0] : ends[-1]].hex().upper().encode()
    doubled = ((ends - ends[0]) * 2).astype(np.int32)
    if array.null_count or array.offset:
        valid = pc.is_valid(array)
        return pc.if_else(valid, _strings(len(array), None, doubled, digits), pa.scalar(None, pa.string()))
    return _strings(len(array), valid, doubled, digits)


def _strings(count: int, valid: pa.Buffer | None, offsets: Any, data: bytes) -> pa.Array:
    return pa.Array.from_buffers(pa.string(), count, [valid, pa.py_buffer(offsets.tobytes()), pa.py_buffer(data)])


def _numbers(array: pa.Array) -> pa.Array:
    """Write lists of numbers as JSON: `[1,2,null]`."""
    inner = array.values.cast(pa.string())
    if pa.types.is_floating(array.type.value_type):
        for plain, quoted in _SPECIAL.items():
            inner = pc.if_else(pc.equal(inner, plain), quoted, inner)
    inner = pc.fill_null(inner, "null")
    texts = pa.Array.from_buffers(
        pa.list_(pa.string()), len(array), array.buffers()[:2], offset=array.offset, children=[inner]
    )
    return pc.binary_join_element_wise("[", pc.binary_join(texts, ","), "]", "")


def _json(array: pa.Array) -> pa.Array:
    texts = [None if row is None else json.dumps(_plain(row), separators=(",", ":")) for row in array.to_pylist()]
    return pa.array(texts, pa.string())


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(cell) for key, cell in value.items()}
    if isinstance(value, list):
        return [_plain(cell) for cell in value]
    return number(value) if isinstance(value, float) else value
