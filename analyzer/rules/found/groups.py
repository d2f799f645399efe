"""Rows of occurrences that belong together: those of one bus, node, type and key, in the runs that they are."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer._native import OccurrenceGroups
from analyzer.rules.found.runs import PAUSE, PIECE

if TYPE_CHECKING:
    from dissectors.kit import Array, Occurrences

    Apart = tuple[int, int]
    Piece = tuple[tuple[int, int], tuple[int, int], int, int]

# What ends a piece, in ns: a longer pause, and a time that can be divided by the second number, unless that is 0.
BY_PAUSE: Apart = (PAUSE, 0)
BY_PIECE: Apart = (PAUSE, PIECE)  # of what may be explained
ALL_ONE: Apart = ((1 << 63) - 1, 0)


def groups_of(found: Occurrences, near_drops: Array | None, apart: Apart) -> OccurrenceGroups:
    """Return the rows by what keeps them apart, those of each group in order of place.

    They come in pieces, each of which belongs to one run, as `apart` says.
    """
    places = found.t, found.frame, found.bus, found.node, found.type
    masks = [None if mask is None else mask.view(np.uint8) for mask in (near_drops, found.doubtful)]
    key = None if found.key is None else _numbers(found.key)
    return OccurrenceGroups([np.asarray(column, np.int64) for column in places], key, masks, apart)


def _numbers(keys: Array) -> Array:
    """Return a number for each key, in their order and equal for those that are."""
    if keys.dtype.kind in "iu" and keys.dtype != np.uint64:
        return keys.astype(np.int64)
    return np.unique(keys, return_inverse=True)[1]
