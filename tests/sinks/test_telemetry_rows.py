"""Native Protocol Buffers encoding against Google's decoder: any columns, nulls, slices, nesting."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import pyarrow as pa
import pytest
from google.protobuf import descriptor_pool, message_factory
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from hypothesis import given
from hypothesis import strategies as st
from kit.exported import same
from kit.strategies import examples

from analyzer import _native
from analyzer.sinks.telemetry_rows import encode
from analyzer.sinks.telemetry_schema import schema

if TYPE_CHECKING:
    from google.protobuf.message import Message

INTEGERS = [getattr(pa, f"{sign}int{bits}")() for sign in ("", "u") for bits in (8, 16, 32, 64)]
FLOATS = [pa.float32(), pa.float64()]
PLAIN = [*INTEGERS, *FLOATS, pa.bool_(), pa.string()]


def kinds() -> st.SearchStrategy[pa.DataType]:
    """Numbers, flags, texts; lists of them; structures of all that, also in lists."""
    plain = st.sampled_from(PLAIN)
    lists = plain.map(pa.list_)

    def structure(of: st.SearchStrategy[pa.DataType]) -> st.SearchStrategy[pa.DataType]:
        return st.lists(of, min_size=1, max_size=3).map(
            lambda some: pa.struct([(f"m{k}", t) for k, t in enumerate(some)])
        )

    inner = structure(plain | lists)
    return plain | lists | inner | inner.map(pa.list_) | structure(inner | plain)


def cells(kind: pa.DataType, null: bool = True) -> st.SearchStrategy[Any]:
    values: st.SearchStrategy[Any]
    if pa.types.is_integer(kind):
        low, high = (0, 2**kind.bit_width - 1) if pa.types.is_unsigned_integer(kind) else (
            -(2 ** (kind.bit_width - 1)), 2 ** (kind.bit_width - 1) - 1
        )  # fmt: skip
        values = st.integers(low, high)
    elif pa.types.is_floating(kind):
        values = st.floats(width=kind.bit_width)
    elif pa.types.is_boolean(kind):
        values = st.booleans()
    elif pa.types.is_string(kind):
        values = st.text(max_size=200)
    elif pa.types.is_list(kind):
        values = st.lists(cells(kind.value_type, null=pa.types.is_floating(kind.value_type)), max_size=5)
    else:
        values = st.fixed_dictionaries({kind.field(k).name: cells(kind.field(k).type) for k in range(kind.num_fields)})
    return st.none() | values if null else values


@st.composite
def tables(draw: st.DrawFn) -> pa.RecordBatch:
    columns = draw(st.lists(kinds(), min_size=1, max_size=4))
    count = draw(st.integers(0, 12))
    made = [pa.array(draw(st.lists(cells(kind), min_size=count, max_size=count)), kind) for kind in columns]
    whole = pa.RecordBatch.from_arrays(made, [f"c{k}" for k in range(len(made))])
    start = draw(st.integers(0, count))
    return whole.slice(start, draw(st.integers(0, count - start)))


def value(message: Message) -> dict[str, Any]:
    out: dict[str, Any] = {}
    for field in message.DESCRIPTOR.fields:
        cell = getattr(message, field.name)
        if field.is_repeated:
            out[field.name] = [value(one) if field.message_type else one for one in cell]
        elif message.HasField(field.name):
            out[field.name] = value(cell) if field.message_type else cell
        else:
            out[field.name] = None
    return out


def wanted(cell: Any, kind: pa.DataType) -> Any:
    if pa.types.is_list(kind):
        return [math.nan if one is None else wanted(one, kind.value_type) for one in cell or []]
    if pa.types.is_struct(kind) and cell is not None:
        return {
            kind.field(k).name: wanted(cell[kind.field(k).name], kind.field(k).type) for k in range(kind.num_fields)
        }
    return cell


@pytest.mark.slow
@examples(300, derandomize=True)
@given(tables())
def test_google_reads_what_was_written(table: pa.RecordBatch) -> None:
    of = schema("Table", table.schema)
    pool = descriptor_pool.DescriptorPool()
    pool.Add(FileDescriptorSet.FromString(of.descriptors).file[0])
    kind = message_factory.GetMessageClass(pool.FindMessageTypeByName(of.name))
    ends, data = encode(table, of.columns)
    places = [0, *memoryview(ends).cast("Q").tolist()]
    assert (len(places), places[-1]) == (len(table) + 1, len(data))
    for row, start, end in zip(table.to_pylist(), places, places[1:], strict=False):
        message = kind.FromString(data[start:end])
        assert same(value(message), {f.name: wanted(row[f.name], f.type) for f in table.schema})


@pytest.mark.parametrize(
    ("column", "reason"),
    [
        ((1, "uint8", None, b"\0", b"", []), "too short"),
        ((1, "uint16", None, b"\0\0\0", b"", []), "Slop"),
        ((0, "uint8", None, b"\0\0", b"", []), "field number"),
        ((1, "bytes", None, b"ab", b"\0" * 8, []), "missing"),
        ((1, "list", None, b"", b"\0" * 12, []), "nothing"),
        ((1, "complex", None, b"", b"", []), "no kind complex"),
    ],
)
def test_columns_that_do_not_fit(column: Any, reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        _native.protobuf(2, [column])
    with pytest.raises(ValueError, match="fit together"):
        _native.message_records([(b"\1\0", b"", b"", b"")], 0, 1)
    with pytest.raises(ValueError, match="no column"):
        _native.FrameBatch.of({}, {}, [])
