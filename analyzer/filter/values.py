"""Columns of values while a filter is evaluated: any number of them a row, of numbers, words or bytes."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable, Sequence

    from dissectors.kit import Array


class CodedWords(NamedTuple):
    """Texts as places in a list of words."""

    codes: Array
    words: Sequence[str]

    def take(self, rows: Array) -> CodedWords:
        """Return some of them."""
        return CodedWords(self.codes[rows], self.words)

    def those(self, holds: Callable[[str], bool]) -> Array:
        """Return a mask of the texts that something holds for; it is asked once a word."""
        if not len(self.words):
            return np.zeros(len(self.codes), bool)
        found: Array = np.array([holds(word) for word in self.words], bool)[self.codes]
        return found

    def changed(self, change: Callable[[str], str]) -> CodedWords:
        """Return the texts with each word changed."""
        return CodedWords(self.codes, [change(word) for word in self.words])


class ByteSpans(NamedTuple):
    """Bytes as places in a buffer: `start` and `end` of each value."""

    buffer: Array
    start: Array
    end: Array

    def take(self, rows: Array) -> ByteSpans:
        """Return some of them."""
        return ByteSpans(self.buffer, self.start[rows], self.end[rows])

    @property
    def lengths(self) -> Array:
        """Number of bytes of each."""
        return self.end - self.start

    def each(self) -> list[bytes]:
        """Return them one by one."""
        whole = self.buffer.tobytes()
        return [whole[a:b] for a, b in zip(self.start.tolist(), self.end.tolist(), strict=True)]

    def equal(self, value: bytes) -> Array:
        """Return which are these bytes."""
        found: Array = self.lengths == len(value)
        if value and found.any():
            at = self.start[found][:, None] + np.arange(len(value))
            found[found] = (self.buffer[at] == np.frombuffer(value, np.uint8)).all(axis=1)
        return found

    def holding(self, value: bytes) -> Array:
        """Return which have these bytes inside."""
        if not value:
            return np.ones(len(self.start), bool)
        last = len(self.buffer) - len(value) + 1
        if last <= 0 or not len(self.start):
            return np.zeros(len(self.start), bool)
        here = np.ones(last, bool)
        for k, byte in enumerate(value):
            here &= self.buffer[k : k + last] == byte
        before = np.concatenate(([0], np.cumsum(here)))
        stop = np.minimum(self.end - len(value) + 1, last)
        found: Array = (stop > self.start) & (before[np.maximum(stop, 0)] > before[np.minimum(self.start, last)])
        return found


class Values(NamedTuple):
    """Values by row.

    Attributes:
        row: the row of each value; None for one a row, in order.
        data: numbers or flags (numpy), words or bytes.
        has: mask of the values that are there, None for all.
        key: values with the same key stand side by side: fields of the same packets, elements of lists of one length.
        place, length: of list elements, their place in the list and how long that is.
    """

    row: Array | None
    data: Array | CodedWords | ByteSpans
    has: Array | None = None
    key: Hashable = None
    place: Array | None = None
    length: Array | None = None

    @property
    def amount(self) -> int:
        """Number of values, those that are not there too."""
        return len(self.data[-1] if isinstance(self.data, ByteSpans) else self.plain)

    @property
    def plain(self) -> Array:
        """Numbers, or codes of words."""
        return self.data.codes if isinstance(self.data, CodedWords) else self.data  # type: ignore[return-value]

    def there(self) -> Array:
        """Return a mask of the values that are there."""
        return np.ones(self.amount, bool) if self.has is None else self.has

    def rows(self) -> Array:
        """Return the row of each value."""
        return np.arange(self.amount) if self.row is None else self.row

    def take(self, some: Array) -> Values:
        """Return some of the values, by place."""
        parts = [None if one is None else one[some] for one in (self.has, self.place, self.length)]
        return Values(self.rows()[some], _taken(self.data, some), parts[0], None, parts[1], parts[2])

    def with_data(self, data: Array | CodedWords | ByteSpans, has: Array | None = None) -> Values:
        """Return other values at the same places; `has` holds beside those that are not there already."""
        both = self.has if has is None else has if self.has is None else self.has & has
        return self._replace(data=data, has=both)


def _taken(data: Array | CodedWords | ByteSpans, some: Array) -> Array | CodedWords | ByteSpans:
    return data.take(some) if isinstance(data, (CodedWords, ByteSpans)) else data[some]


NO_NUMBERS = Values(np.zeros(0, np.int64), np.zeros(0, np.int64))


def any_row(values: Values, good: Array, size: int) -> Array:
    """Return the rows with a value that is there and good."""
    good = good if values.has is None else good & values.has
    if values.row is None:
        return good
    found = np.zeros(size, bool)
    found[values.row[good]] = True
    return found


def every_row(values: Values, good: Array, size: int) -> Array:
    """Return the rows with values of which all are good."""
    there = any_row(values, np.ones(values.amount, bool), size)
    return there & ~any_row(values, ~good, size)


def joined(left: Values, right: Values, size: int) -> tuple[Values, Values]:
    """Return both with values side by side: those of the same key, else each with each of the same row."""
    if (left.row is None and right.row is None) or _aligned(left, right):
        return left, right
    if left.row is None:
        return left.take(right.rows()), right
    if right.row is None:
        return left, right.take(left.row)
    found = spread(left, right.row, size)
    at = found.rows()
    return found._replace(row=right.row[at]), right.take(at)


def _aligned(left: Values, right: Values) -> bool:
    if left.key is None or left.key != right.key or left.amount != right.amount:
        return False
    if (left.place is None) != (right.place is None) or not np.array_equal(left.rows(), right.rows()):
        return False
    return left.place is None or right.place is None or bool(np.array_equal(left.place, right.place))


def spread(values: Values, owner: Array, size: int) -> Values:
    """Return for each place of `owner` all values of the row that it names; `row` is then that place."""
    if values.row is None:
        one = values.take(owner)
        return one._replace(row=np.arange(len(owner)), key=values.key)
    order = np.argsort(values.row, kind="stable")
    counts = np.bincount(values.row, minlength=size)
    starts = np.cumsum(counts) - counts
    repeats = counts[owner]
    total = int(repeats.sum())
    row = np.repeat(np.arange(len(owner)), repeats)
    inside = np.arange(total) - np.repeat(np.cumsum(repeats) - repeats, repeats)
    taken = values.take(order[starts[owner][row] + inside])
    return taken._replace(row=row, key=values.key)
