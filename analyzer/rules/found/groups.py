"""Rows of occurrences that belong together: those of one bus, node, type and key, in the runs that they are."""

from __future__ import annotations

from itertools import groupby, pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from analyzer.rules.found.runs import PAUSE, PIECE

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from dissectors.kit import Array, Occurrences

FEW = 16  # rows that are sorted as a list: that takes less than a column of them does


def pieces_by_key(
    found: Occurrences, near_drops: Sequence[bool] | None, apart: Callable[[Any], Any]
) -> Iterator[tuple[Sequence[Any], bool, bool, int, int, int]]:
    """Yield rows that belong to one key each, in order of place, and what is true of all of them behind these.

    They come in pieces, each of which belongs to one run, as `apart` says. Behind them stands whether lost frames may
    explain them, whether they are doubtful, their bus, their node, the number of their type.
    """
    if len(found.t) <= FEW:
        yield from _few_by_key(found, near_drops, apart)
        return
    none = np.zeros(len(found.t), bool)
    noted = none if near_drops is None else np.asarray(near_drops, bool)
    doubtful = none if found.doubtful is None else np.asarray(found.doubtful, bool)
    code = found.bus.astype(np.int64) << 9 | (found.node.astype(np.int64) + 1)
    code = (code * (1 << 34) + found.type.astype(np.int64)) * 4 + noted * 2 + doubtful
    parts = [found.frame, found.t, code]
    if found.key is not None:
        parts.insert(2, _ranks(found.key))
    order = np.lexsort(parts)
    changed = np.zeros(len(order) - 1, bool)
    for part in parts[2:]:
        changed |= np.diff(part[order]) != 0
    first = order[np.concatenate(([True], changed))]
    same = (column[first].tolist() for column in (noted, doubtful, found.bus, found.node, found.type))
    begins = changed | apart(found.t[order])
    pieces, ends = split(order, begins), np.flatnonzero(changed[begins]) + 1
    each = (pieces[start:stop] for start, stop in pairwise([0, *ends.tolist(), len(pieces)]))
    yield from zip(each, *same, strict=True)


def _few_by_key(
    found: Occurrences, near_drops: Sequence[bool] | None, apart: Callable[[Any], Any]
) -> Iterator[tuple[Sequence[Any], bool, bool, int, int, int]]:
    """Yield the same of a few rows: as a list of them is sorted before a column is."""
    size = len(found.t)
    none = [False] * size
    noted = none if near_drops is None else list(map(bool, near_drops))
    doubtful = none if found.doubtful is None else np.asarray(found.doubtful, bool).tolist()
    keys = none if found.key is None else _ranks(found.key).tolist()
    columns = (found.bus.tolist(), found.node.tolist(), found.type.tolist(), noted, doubtful, keys)
    codes, t, frame = list(zip(*columns, strict=True)), found.t.tolist(), found.frame.tolist()
    rows = sorted(range(size), key=lambda row: (codes[row], t[row], frame[row]))
    for code, same in groupby(rows, key=codes.__getitem__):
        bus, node, number, near, turned, _ = code
        own = np.array(list(same))
        yield split(own, apart(found.t[own])) if len(own) > 1 else [own], near, turned, bus, node, number


def _ranks(keys: Array) -> Array:
    """Return a number for each key, equal for those that are."""
    return np.unique(keys, return_inverse=True)[1]


def by_place(found: Occurrences, parts: Sequence[Any]) -> Any:
    """Return the rows of some groups together, in order of place."""
    rows = np.concatenate(parts)
    return rows[np.lexsort((found.frame[rows], found.t[rows]))]


def by_pause(t: Any) -> Any:
    """Return of each time but the first whether a run begins with it."""
    return t[1:] - t[:-1] > PAUSE


def by_piece(t: Any) -> Any:
    """Return of each time but the first whether a run begins with it, or a piece of what may be explained."""
    piece = t // PIECE
    return by_pause(t) | (piece[1:] != piece[:-1])


def all_one(t: Any) -> Any:
    """Return of each time but the first that no run begins with it."""
    return np.zeros(max(len(t) - 1, 0), bool)


def split(rows: Any, begins: Any) -> list[Any]:
    """Return rows in parts; of each one but the first is said whether a part begins with it."""
    return [rows[start:stop] for start, stop in pairwise([0, *(np.flatnonzero(begins) + 1).tolist(), len(rows)])]
