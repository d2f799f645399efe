"""Rows in groups, and what changes from row to row: the steps by which rules go over columns instead of rows."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit.array import Array

_SHORT = 1 << 16  # keys below this sort in one pass over the rows


def by_key(keys: Array) -> tuple[Array, Array]:
    """Return the places in the order of keys, those of one key in order, and where in that each key begins.

    Keys are not negative.
    """
    if not len(keys):
        return np.empty(0, np.int64), np.empty(0, np.int64)
    keys = keys.astype(np.uint16) if int(keys.max()) < _SHORT else keys
    order = np.argsort(keys, kind="stable")
    ordered = keys[order]
    begins = np.empty(len(keys), bool)
    begins[0] = True
    np.not_equal(ordered[1:], ordered[:-1], out=begins[1:])
    return order, np.flatnonzero(begins)


def groups(keys: Array) -> Iterator[tuple[int, Array]]:
    """Yield each key in order, and the places at which it stands, in order; keys are not negative."""
    order, begins = by_key(keys)
    first = [*begins.tolist(), len(keys)]
    for start, stop in pairwise(first):
        yield int(keys[order[start]]), order[start:stop]


def changes(values: Array, before: float) -> Array:
    """Return the places of values that differ from the one in front, which is `before` for the first."""
    differs = np.empty(len(values), bool)
    np.not_equal(values[1:], values[:-1], out=differs[1:])
    differs[:1] = values[:1] != before
    return np.flatnonzero(differs)


def last_set(mask: Array) -> Array:
    """Return for each place the last one up to it, itself included, where the mask is set; -1 where there is none."""
    return np.maximum.accumulate(np.where(mask, np.arange(len(mask)), -1))
