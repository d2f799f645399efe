"""Memory across batches: the previous rows of the same node, the last number of a key; and clocks that step back."""

from __future__ import annotations

from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np

from dissectors.kit.rows import NODES
from dissectors.times import MILLISECOND

if TYPE_CHECKING:
    from dissectors.kit.array import Array

_PAGE = 12
_REST = (1 << _PAGE) - 1
_STEP = 10 * MILLISECOND  # by less, frames only came in another order

Number = TypeVar("Number", int, float)


class Previous:
    """Several values of each node, as they were in the row before.

    A value whose start or column is a float is kept as float64, a column of uint64 as uint64, others as int64.

    Args:
        start: the values of a node that sent nothing yet; not negative for a column of uint64.
    """

    def __init__(self, *start: float) -> None:
        self._start = start
        # As long as the highest node so far needs: memory for all buses would be touched for nothing.
        self._last: list[Array] = [np.empty(0, _kind(one)) for one in start]

    def all(self, value: float) -> bool:
        """Return whether the last values of all nodes are this."""
        unseen = len(self._last[0]) == NODES or all(one == value for one in self._start)
        return unseen and all(bool((last == value).all()) for last in self._last)

    def feed(self, node: Array, *values: Array) -> tuple[tuple[Array, ...], Array]:
        """Add the rows of a batch; return the previous values of each, an array for each value, and the previous row.

        `node` is as `sender` gives it; a previous row is -1 if it stood in an earlier batch or was none.
        """
        order = np.argsort(node, kind="stable")
        nodes = node[order]
        starts, ends = np.ones((2, len(nodes)), bool)
        np.not_equal(nodes[1:], nodes[:-1], out=starts[1:])
        ends[:-1] = starts[1:]
        room = 1 << int(nodes[-1]).bit_length() if len(nodes) else 0
        before = []
        for k, column in enumerate(values):
            last = self._last[k]
            if room > len(last):
                last = np.append(last, np.full(room - len(last), self._start[k], last.dtype))
            last = self._last[k] = _wide_enough(last, column)
            ordered = column[order].astype(last.dtype)
            previous = np.empty_like(ordered)
            previous[1:] = ordered[:-1]
            previous[starts] = last[nodes[starts]]
            last[nodes[ends]] = ordered[ends]
            found = np.empty_like(ordered)
            found[order] = previous
            before.append(found)
        row = np.empty(len(nodes), np.int64)
        row[order[1:]] = order[:-1]
        row[order[starts]] = -1
        return tuple(before), row


class Latest(Generic[Number]):
    """A number for each key, the last one said. Keys are small numbers from 0.

    Args:
        start: the number of a key of which nothing was said; a float if the numbers are floats.
    """

    def __init__(self, start: Number) -> None:
        self._start: Number = start
        self._values: dict[int, Array] = {}

    def get(self, key: int) -> Number:
        """Return what is known of a key."""
        page = self._values.get(key >> _PAGE)
        number: Number = self._start if page is None else page[key & _REST].item()
        return number

    def feed(self, keys: Array, values: Array) -> None:
        """Keep the values of a batch in their order; the last one of a key stays.

        A page of 4,096 numbers is kept for each `key >> 12`.
        """
        if values.dtype.kind == "f" and not isinstance(self._start, float):
            raise TypeError("floats need a start that is a float")
        pages = keys >> _PAGE
        for number in np.flatnonzero(np.bincount(pages)).tolist():
            page = self._values.get(number)
            if page is None:
                # Zeros that nobody wrote cost no memory.
                page = np.zeros(1 << _PAGE, _kind(self._start))
                if self._start:
                    page.fill(self._start)
            page = self._values[number] = _wide_enough(page, values)
            here = pages == number
            page[keys[here] & _REST] = values[here]


def set_back(t: Array) -> Array:
    """Return the places in the times of a bus's frames at which the recorder's clock was set back by 10 ms or more."""
    return np.flatnonzero(t[1:] <= t[:-1] - _STEP) + 1


def _kind(start: float) -> type:
    return np.float64 if isinstance(start, float) else np.int64


def _wide_enough(last: Array, column: Array) -> Array:
    """Return the last values in a type that holds those of a column as they are."""
    if column.dtype.kind == "f":
        return last.astype(np.float64, copy=False)
    if column.dtype == np.uint64 and last.dtype == np.int64:
        if (last < 0).any():
            raise ValueError("a column of uint64 needs a start that is not negative")
        return last.astype(np.uint64)
    return last
