"""Rows in groups, and what changes from row to row: the steps by which rules go over columns instead of rows."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit.array import Array

_SHORT, _BYTE = 1 << 16, 0xFF  # keys below these sort in one pass over the rows


def by_key(keys: Array) -> tuple[Array, Array]:
    """Return the places in the order of keys, those of one key in order, and where in that each key begins.

    Keys are not negative.
    """
    if not len(keys):
        return np.empty(0, np.int64), np.empty(0, np.int64)
    order = _sorted(keys)
    ordered = keys[order]
    begins = np.empty(len(keys), bool)
    begins[0] = True
    np.not_equal(ordered[1:], ordered[:-1], out=begins[1:])
    return order, begins.nonzero()[0]


def _sorted(keys: Array) -> Array:
    """Return the places in the order of keys: 16 bits of them at a time, lowest first, which takes one pass each."""
    most = int(keys.max())
    if most < _SHORT:
        return np.argsort(keys.astype(np.uint16), kind="stable")
    order: Array | None = None
    for shift in range(0, most.bit_length(), 16):
        part = (keys >> shift if shift else keys).astype(np.uint16 if most >> shift > _BYTE else np.uint8)
        if int(part.min()) == int(part.max()):
            continue
        order = np.argsort(part, kind="stable") if order is None else order[np.argsort(part[order], kind="stable")]
    return np.arange(len(keys)) if order is None else order


def groups(keys: Array) -> Iterator[tuple[int, Array]]:
    """Yield each key in order, and the places at which it stands, in order; keys are not negative."""
    order, begins = by_key(keys)
    first = [*begins.tolist(), len(keys)]
    for start, stop in pairwise(first):
        yield int(keys[order[start]]), order[start:stop]


def spans(keys: Array) -> Iterator[tuple[int, int, int]]:
    """Yield each key of some that stand together, where it begins, and where it ends."""
    first = [0, *((keys[1:] != keys[:-1]).nonzero()[0] + 1).tolist(), len(keys)]
    for start, stop in pairwise(first) if len(keys) else ():
        yield keys.item(start), start, stop


def changes(values: Array, before: float) -> Array:
    """Return the places of values that differ from the one in front, which is `before` for the first."""
    differs = np.empty(len(values), bool)
    np.not_equal(values[1:], values[:-1], out=differs[1:])
    differs[:1] = values[:1] != before
    return differs.nonzero()[0]


def steps(values: Array, before: float) -> Array:
    """Return how far each value is from the one in front, which is `before` for the first."""
    found = np.empty_like(values)
    found[:1] = values[:1] - before
    np.subtract(values[1:], values[:-1], out=found[1:])
    return found


def count_below(marks: Array, numbers: Array) -> Array:
    """Return how many marks are below each number; both are in order."""
    if len(marks) >= len(numbers):
        return marks.searchsorted(numbers)
    steps = np.zeros(len(numbers) + 1, np.int64)
    np.add.at(steps, numbers.searchsorted(marks, "right"), 1)
    return np.cumsum(steps[:-1])


def last_set(mask: Array) -> Array:
    """Return for each place the last one up to it, itself included, where the mask is set; -1 where there is none."""
    return np.maximum.accumulate(np.where(mask, np.arange(len(mask)), -1))
