"""The columns of any table as numbers: structures member by member, lists element by element."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np
import pyarrow as pa

from analyzer.facts.meaning import meaning
from dissectors.kit.cells import numbers, valid
from dissectors.records import dataclass, replace

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from dissectors.kit import Array
    from dissectors.schema import Message, Packet

MOST_ELEMENTS = 32
# What a table says of its rows rather than of what they carry.
ABOUT_ROWS = frozenset({
    "transfer", "t", "bus", "src", "dst", "trusted", "bits_left", "pad_nonzero", "bad_tag", "layout", "offset",
    "packet_ok", "header_ok", "length_ok", "complete", "checksum_ok", "checksum_end", "count_step", "count_step_id",
    "big_endian", "reason", "decided",
})  # fmt: skip


@dataclass(frozen=True, slots=True)
class Column:
    """Numbers of a column, a row each. `has` are the rows that have one, None for all."""

    name: tuple[str, ...]
    values: Array
    has: Array | None
    kind: Literal["number", "enum", "flag"]
    unit: str
    texts: Mapping[float, str]


def columns(
    of: Message | Packet | None, table: pa.RecordBatch, leave: frozenset[str] = frozenset()
) -> Iterator[Column]:
    """Yield the numbers of a table that are not in `leave`; texts, and lists that are text or digits, are none."""
    for field in table.schema:
        if field.name not in ABOUT_ROWS and field.name not in leave:
            yield from _flat(of, field.name, (field.name,), table.column(field.name), None)


def column(of: Message | Packet | None, table: pa.RecordBatch, name: str) -> list[Column]:
    """Return one column: itself, or its elements in order; none if the table does not have it."""
    if name not in table.schema.names:
        return []
    return list(_flat(of, name, (name,), table.column(name), None))


def elements(of: Message | Packet | None, table: pa.RecordBatch, name: str) -> tuple[Array, Array, Column] | None:
    """Return all numbers in a column of lists: the row of each, its place in the list, and the numbers.

    None if it has none.
    Places from `MOST_ELEMENTS` on are left out.
    """
    array = table.column(name) if name in table.schema.names else None
    if array is None or not pa.types.is_list(array.type) or pa.types.is_nested(array.type.value_type):
        return None
    offsets = np.asarray(array.offsets).astype(np.int64)
    counts = np.diff(offsets)
    row = np.repeat(np.arange(len(counts)), counts)
    place = np.arange(len(row)) - np.repeat(offsets[:-1] - offsets[0], counts)
    values = array.values.slice(offsets[0], len(row)) if len(offsets) else array.values
    found = _number(of, name, (name,), values, _both(None, values))
    has = found.has if found.has is not None else np.ones(len(row), bool)
    return row, place, replace(found, has=has & (place < MOST_ELEMENTS))


def even(of: Message | Packet | None, table: pa.RecordBatch, name: str) -> Array | None:
    """Return the numbers in a column of lists as a row each, if they are all equally long and say everything."""
    array = table.column(name) if name in table.schema.names else None
    if array is None or not pa.types.is_list(array.type) or pa.types.is_nested(array.type.value_type):
        return None
    offsets = np.asarray(array.offsets)
    counts = np.diff(offsets)
    if not len(counts) or not 0 < counts[0] <= MOST_ELEMENTS or (counts != counts[0]).any() or array.null_count:
        return None
    values = array.values.slice(offsets[0], int(offsets[-1] - offsets[0]))
    found = _number(of, name, (name,), values, _both(None, values))
    return found.values.reshape(len(counts), -1) if found.has is None else None


def _flat(
    of: Message | Packet | None,
    dotted: str,
    name: tuple[str, ...],
    array: pa.Array,
    has: Array | None,
) -> Iterator[Column]:
    kind = array.type
    if pa.types.is_struct(kind):
        has = _both(has, array)
        for k in range(kind.num_fields):
            inner = kind.field(k).name
            yield from _flat(of, f"{dotted}.{inner}", (*name, inner), array.field(k), has)
    elif pa.types.is_list(kind):
        note = meaning(of, dotted).note
        if note is None or not (note.text or note.hex):
            yield from _elements(of, dotted, name, array, has)
    elif pa.types.is_boolean(kind):
        yield Column(name, numbers(array), _both(has, array), "flag", "", {})
    elif pa.types.is_integer(kind) or pa.types.is_floating(kind):
        yield _number(of, dotted, name, array, _both(has, array))


def _number(
    of: Message | Packet | None, dotted: str, name: tuple[str, ...], array: pa.Array, has: Array | None
) -> Column:  # fmt: skip
    found = meaning(of, dotted)
    values = numbers(array)
    enum = found.note.enum if found.note is not None else found.part.enum if found.part is not None else {}
    if enum and pa.types.is_integer(array.type):
        return Column(name, values, has, "enum", found.unit, found.texts)
    special = [raw for raw in found.texts if found.note is not None] if not enum else []
    if any((values == raw).any() for raw in special):
        plain = ~np.isin(values, special)
        has = plain if has is None else has & plain
    return Column(name, values, has, "number", found.unit, {})


def _elements(
    of: Message | Packet | None, dotted: str, name: tuple[str, ...], array: pa.Array, has: Array | None
) -> Iterator[Column]:  # fmt: skip
    if pa.types.is_list(array.type.value_type):
        return
    offsets = np.asarray(array.offsets).astype(np.int64)
    counts = np.diff(offsets)
    has = _both(has, array)
    if has is not None:
        counts = np.where(has, counts, 0)
    most = int(counts.max()) if len(counts) else 0
    for k in range(min(most, MOST_ELEMENTS)):
        inside = counts > k
        whole = bool(inside.all())
        picked = array.values.take(pa.array(np.where(inside, offsets[:-1] + k, offsets[:-1][inside][0] + k)))
        yield from _flat(of, dotted, (*name, str(k)), picked, None if whole else inside)


def _both(has: Array | None, array: pa.Array) -> Array | None:
    if not array.null_count:
        return has
    own = valid(array)
    return own if has is None else has & own
