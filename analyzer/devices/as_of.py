"""Values as they were when something else was said, across batches."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING

import numpy as np

from dissectors.records import dataclass

if TYPE_CHECKING:
    from dissectors.kit import Array

MOST_KEYS = 1 << 14  # whose values are kept for later batches


@dataclass(frozen=True, slots=True)
class ToldValues:
    """Values by key, each of which holds from its place on. `t` is when it was told, in nanoseconds.

    Places are of any clock: only their order counts.
    """

    key: Array
    place: Array
    value: Array
    t: Array

    def take(self, rows: Array) -> ToldValues:
        """Return some of them."""
        return ToldValues(*(getattr(self, one.name)[rows] for one in fields(self)))


def joined(some: ToldValues, more: ToldValues) -> ToldValues:
    """Return both, by key and place."""
    both = ToldValues(*(np.concatenate([getattr(some, one.name), getattr(more, one.name)]) for one in fields(some)))
    return both.take(np.lexsort((both.place, both.key)))


class AsOf:
    """Joins values to places that come in any batch; of each key the last value is kept, and those that are recent.

    Args:
        recent: how far behind the latest place somebody may still ask for a value, when the next batch comes.
    """

    def __init__(self, recent: int = 0) -> None:
        self._recent = recent
        none = np.zeros(0, np.int64)
        self._kept = ToldValues(none, none, none.astype(np.float64), none)

    def feed(self, told: ToldValues) -> None:
        """Take values of a batch, before somebody asks for places in it."""
        self._kept = joined(self._kept, told)

    def ask(self, key: Array, place: Array) -> tuple[Array, Array, Array]:
        """Return whether something was told of each key before or at that place, what that was, and when."""
        kept = self._kept
        known, at = np.zeros(len(key), bool), np.zeros(len(key), np.int64)
        for one in np.unique(key).tolist():
            start, end = np.searchsorted(kept.key, [one, one + 1])
            mine = np.flatnonzero(key == one)
            before = np.searchsorted(kept.place[start:end], place[mine], "right")
            known[mine], at[mine] = before > 0, start + np.maximum(before - 1, 0)
        at[~known] = 0
        if not known.any():
            return known, np.full(len(key), np.nan), at
        return known, np.where(known, kept.value[at], np.nan), kept.t[at]

    def forget(self) -> None:
        """Leave only what later batches may ask for."""
        kept = self._kept
        if not len(kept.key):
            return
        recent = kept.place > int(kept.place.max()) - self._recent
        same, soon = kept.key[1:] == kept.key[:-1], recent[1:]
        needed = recent | np.append(~same | soon, True)
        kept = kept.take(np.flatnonzero(needed))
        self._kept = kept.take(np.flatnonzero(np.isin(kept.key, np.unique(kept.key)[:MOST_KEYS])))
