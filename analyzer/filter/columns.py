"""Columns of message tables as values by row: out of structures and lists, one number or word each."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from analyzer.filter.history import spans_of
from analyzer.filter.values import ByteSpans, CodedWords, Values
from dissectors.kit.cells import numbers, text_of, valid

if TYPE_CHECKING:
    from analyzer.filter.fields import FieldRef
    from dissectors.kit import Array


def column_values(table: pa.RecordBatch, ref: FieldRef, row: Array) -> Values | None:
    """Return a field of a table, `row` being the row of each of its rows; None if this table does not have it."""
    if ref.column not in table.schema.names:
        return None
    array = table.column(ref.column)
    place = length = None
    has: Array | None = None
    at = np.arange(len(table))
    for name in (*ref.path, None):
        if pa.types.is_list(array.type) and not (name is None and ref.kind.sort in ("bytes", "text")):
            ends = np.asarray(array.offsets).astype(np.int64)
            counts = np.diff(ends)
            if has is not None or array.null_count:
                counts = np.where(_both(has, array), counts, 0)
            inner = np.repeat(np.arange(len(counts)), counts)
            place = np.arange(len(inner)) - np.repeat(np.cumsum(counts) - counts, counts)
            length, has = counts[inner], None
            at = at[inner]
            array = array.values.take(pa.array(ends[:-1][inner] + place))
        if name is not None:
            has = _both(has, array) if array.null_count else has
            array = array.field(name)
    has = _both(has, array) if array.null_count else has
    data = _data(array, ref)
    return Values(row[at], data, has, None, place, length)


def _both(has: Array | None, array: pa.Array) -> Array:
    own = valid(array)
    return own if has is None else has & own


def _data(array: pa.Array, ref: FieldRef) -> Array | CodedWords | ByteSpans:
    kind = array.type
    if pa.types.is_string(kind):
        coded = array.dictionary_encode()
        codes = coded.indices.fill_null(0)
        return CodedWords(np.asarray(codes).astype(np.int64), [word or "" for word in coded.dictionary.to_pylist()])
    if pa.types.is_binary(kind):
        return spans_of(array)
    if pa.types.is_list(kind):
        if ref.kind.sort == "bytes":
            return spans_of(array)
        texts = [text_of(one) for one in spans_of(array).each()]
        words = sorted(set(texts))
        places = {word: k for k, word in enumerate(words)}
        return CodedWords(np.array([places[text] for text in texts], np.int64), words)
    return numbers(array) if len(array) else np.zeros(0, np.int64)


def streams(table: pa.RecordBatch, number: int) -> Array:
    """Return for each row who speaks, as a number: bus, node, table, and the unit or channel that the row names."""
    key = numbers(table.column("bus")).astype(np.int64) << 8 | numbers(table.column("src"))
    which = np.full(len(table), -1, np.int64)
    for name in ("unit", "channel"):
        if name in table.schema.names:
            column = table.column(name)
            told = np.nan_to_num(numbers(column).astype(np.float64), nan=-1)
            which = np.where(valid(column), np.clip(told, -1, 1 << 16), -1).astype(np.int64)
            break
    return (key << 8 | number) << 18 | (which + 1)
