"""How values are compared: numbers, words and bytes, with each other, with constants and with sets."""

from __future__ import annotations

import operator
from typing import TYPE_CHECKING, Any

import numpy as np

from analyzer.filter.fields import Kind
from analyzer.filter.nodes import FieldNode, MappedNode, ValueNode
from analyzer.filter.values import ByteSpans, CodedWords, Values

if TYPE_CHECKING:
    from collections.abc import Callable

    from dissectors.kit import Array

OPERATORS: dict[str, Callable[[Any, Any], Any]] = {
    "==": operator.eq, "!=": operator.ne, "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge,
}  # fmt: skip


def in_words(of: FieldNode) -> ValueNode:
    """Return a number with names as those names."""
    codes = {value: words[0] for value, words in of.kind.texts.items()}
    words = [*codes.values()]
    places = {value: k for k, value in enumerate(codes)}

    def change(values: Values) -> Values:
        known, inverse = np.unique(values.plain, return_inverse=True)
        at = np.array([places.get(value, -1) for value in known.tolist()], np.int64)
        found = at[inverse] if len(known) else np.zeros(0, np.int64)
        return values.with_data(CodedWords(np.maximum(found, 0), words), found >= 0)

    return MappedNode(of, Kind("text"), change)


def words_of(values: Values) -> CodedWords:
    """Return values that are words."""
    assert isinstance(values.data, CodedWords)  # noqa: S101 - types are checked before
    return values.data


def octets_of(values: Values) -> ByteSpans:
    """Return values that are bytes."""
    assert isinstance(values.data, ByteSpans)  # noqa: S101 - types are checked before
    return values.data


def bytes_test(values: Values, op: str, value: bytes) -> Array:
    """Return which values compare so with some bytes."""
    spans = octets_of(values)
    if op in ("==", "!="):
        same = spans.equal(value)
        return same if op == "==" else ~same
    compare = OPERATORS[op]
    return np.array([compare(one, value) for one in spans.each()], bool)


def of_pairs(op: str) -> Callable[[Any, Any], Array]:
    """Return what compares values with others, one by one."""
    compare = OPERATORS[op]

    def holds(a: Any, b: Any) -> Array:
        if isinstance(a, CodedWords):
            one, other = np.array(a.words, object)[a.codes], np.array(b.words, object)[b.codes]
            return np.asarray(compare(one, other), bool)
        if isinstance(a, ByteSpans):
            return np.array([compare(x, y) for x, y in zip(a.each(), b.each(), strict=True)], bool)
        return np.asarray(compare(a, b), bool)

    return holds


def membership(kind: Kind, singles: list[Any], ranges: list[tuple[Any, Any]]) -> Callable[[Values], Array]:
    """Return what finds values that are one of some, or in a range."""
    some = set(singles)

    def one(value: Any) -> bool:
        return value in some or any(low <= value <= high for low, high in ranges)

    if kind.sort == "text":
        return lambda values: words_of(values).those(one)
    if kind.sort == "bytes":
        return lambda values: np.array([one(value) for value in octets_of(values).each()], bool)

    def numbers(values: Values) -> Array:
        plain = values.plain
        found = np.zeros(len(plain), bool)
        if some:
            known, inverse = np.unique(plain, return_inverse=True)
            wanted = {plain.dtype.type(v) if plain.dtype.kind == "f" else v for v in some}
            found |= np.array([v in wanted for v in known.tolist()] or [False], bool)[inverse] if len(known) else found
        for low, high in ranges:
            found |= (plain >= low) & (plain <= high)
        return found

    return numbers
