"""Pieces of bytes, texts and lists: `[4]`, `[0:2]`, `[1-3]`, `[-2:]`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.filter.fields import TEXT, Kind
from analyzer.filter.nodes import MappedNode
from analyzer.filter.values import ByteSpans, CodedWords

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.filter.language.syntax import SlicePiece
    from analyzer.filter.nodes import ValueNode
    from analyzer.filter.values import Values
    from dissectors.kit import Array


def cut(of: ValueNode, pieces: Sequence[SlicePiece]) -> ValueNode | None:
    """Return the pieces of a value; None if it is of a kind that has none."""
    if of.kind.sort == "bytes":
        return MappedNode(of, Kind("bytes", size=size(pieces)), lambda values: _bytes(values, pieces))
    if of.kind.sort == "text":
        return MappedNode(of, TEXT, lambda values: _text(values, pieces))
    if not of.kind.most:
        return None
    return MappedNode(of, of.kind, lambda values: _elements(values, pieces))


def nowhere(of: Kind, pieces: Sequence[SlicePiece]) -> str:
    """Return why one of the pieces is never there, whatever they are pieces of; "" if all may be."""
    whole = of.sort == "bytes"  # a piece of a list is what there is of it
    for piece in pieces:
        size = _size(piece) if whole else 1
        if piece.start < 0 and piece.length is not None and size > -piece.start:
            return f"[{piece.start}:{piece.length}] goes on behind the end: up to there is [{piece.start}:]"
        if of.most and (piece.start < -of.most or piece.start + max(size, 1) > of.most):
            things = "bytes" if whole else "elements"
            return f"there are at most {of.most} {things}: the first is [0], the last [{of.most - 1}]"
    return ""


def size(pieces: Sequence[SlicePiece]) -> int:
    """Return how many bytes pieces of bytes are, 0 if that depends on what they are pieces of."""
    sizes = [_size(piece) for piece in pieces]
    return sum(sizes) if all(sizes) else 0


def _size(piece: SlicePiece) -> int:
    if piece.single:
        return 1
    if piece.length is not None:
        return piece.length
    if piece.end is None:
        return 1 if piece.start == -1 else 0
    return piece.end - piece.start + 1 if (piece.start < 0) == (piece.end < 0) else 0


def byte_values(values: Values) -> Values:
    """Return pieces of one byte as numbers."""
    data = values.data
    assert isinstance(data, ByteSpans)  # noqa: S101 - the caller has looked
    there = data.lengths == 1
    found = np.zeros(len(there), np.int64)
    found[there] = data.buffer[data.start[there]]
    return values.with_data(found, there)


def lengths(values: Values) -> Values:
    """Return how long texts and bytes are."""
    data = values.data
    if isinstance(data, ByteSpans):
        return values.with_data(data.lengths)
    assert isinstance(data, CodedWords)  # noqa: S101 - the caller has looked
    return values.with_data(np.array([len(w.encode()) for w in data.words] or [0], np.int64)[data.codes])


def bounds(piece: SlicePiece, length: Array) -> tuple[Array, Array, Array]:
    """Return start and end of a piece in things of these lengths, and which are long enough."""
    start = np.where(piece.start < 0, length + piece.start, piece.start)
    if piece.end is not None:
        end = np.where(piece.end < 0, length + piece.end, piece.end) + 1
    elif piece.length is not None:
        end = start + piece.length
    else:
        end = length + 0
    return start, end, (start >= 0) & (end <= length) & (start < end)


def _bytes(values: Values, pieces: Sequence[SlicePiece]) -> Values:
    data = values.data
    assert isinstance(data, ByteSpans)  # noqa: S101 - the caller has looked
    found = [bounds(piece, data.lengths) for piece in pieces]
    good = np.logical_and.reduce([fits for _, _, fits in found])
    if len(found) == 1:
        start, end, _ = found[0]
        return values.with_data(
            ByteSpans(data.buffer, data.start + np.where(good, start, 0), data.start + np.where(good, end, 0)), good
        )
    sizes = [np.where(good, end - start, 0) for start, end, _ in found]
    total = np.sum(sizes, axis=0)
    ends = np.cumsum(total)
    buffer = np.zeros(int(ends[-1]) if len(ends) else 0, np.uint8)
    at = ends - total
    for (start, _, _), size in zip(found, sizes, strict=True):
        inside = np.arange(int(size.sum())) - np.repeat(np.cumsum(size) - size, size)
        buffer[np.repeat(at, size) + inside] = data.buffer[
            np.repeat(data.start + np.where(good, start, 0), size) + inside
        ]
        at = at + size
    return values.with_data(ByteSpans(buffer, ends - total, ends), good)


def _text(values: Values, pieces: Sequence[SlicePiece]) -> Values:
    data = values.data
    assert isinstance(data, CodedWords)  # noqa: S101 - the caller has looked
    sizes = np.array([len(word) for word in data.words] or [0], np.int64)
    found = [bounds(piece, sizes) for piece in pieces]
    good = np.logical_and.reduce([fits for _, _, fits in found])
    words = [
        "".join(word[int(start[k]) : int(end[k])] for start, end, _ in found) if good[k] else ""
        for k, word in enumerate(data.words)
    ]
    return values.with_data(CodedWords(data.codes, words), good[data.codes])


def _elements(values: Values, pieces: Sequence[SlicePiece]) -> Values:
    """Return the elements of lists at those places; a field that is no list has one, at 0."""
    place = np.zeros(values.amount, np.int64) if values.place is None else values.place
    length = np.ones(values.amount, np.int64) if values.length is None else values.length
    inside = np.zeros(values.amount, bool)
    for piece in pieces:
        start, end, good = bounds(piece, length)
        if piece.length is not None and not piece.single:
            good = start >= 0
        inside |= good & (place >= start) & (place < end)
    return values.with_data(values.data, inside)._replace(key=None)
