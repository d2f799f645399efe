"""Rows of a batch by what they belong to, and what each group of them adds up to: no loop over rows."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from dissectors.kit import Array

NONE = -1  # in place of a value, time or state that nothing was heard of


class Groups:
    """Rows with equal keys, in their order; groups are in the order of their keys."""

    def __init__(self, keys: Array) -> None:
        self.order = np.argsort(keys, kind="stable")
        ordered = keys[self.order]
        first = np.empty(len(keys), bool)
        first[:1] = True
        np.not_equal(ordered[1:], ordered[:-1], out=first[1:])
        self.starts = np.flatnonzero(first)
        self.keys: list[int] = ordered[self.starts].tolist()

    @cached_property
    def ends(self) -> Array:
        """The end of each group."""
        return np.append(self.starts[1:], len(self.order))

    def spread(self, of_groups: Array) -> Array:
        """Return a value of each group as one of each row."""
        found = np.empty(len(self.order), of_groups.dtype)
        found[self.order] = np.repeat(of_groups, self.ends - self.starts)
        return found

    def last(self, values: Array) -> Array:
        """Return the value of the last row of each group."""
        found: Array = values[self.order[self.ends - 1]]
        return found

    def previous(self, values: Array, before: Array) -> Array:
        """Return for each row the value of the row before it in its group; `before` are those before the first."""
        ordered = values[self.order]
        shifted = np.empty(len(ordered), np.int64)
        shifted[1:] = ordered[:-1]
        shifted[self.starts] = before
        found = np.empty(len(ordered), np.int64)
        found[self.order] = shifted
        return found

    def longest(self, t: Array, before: Array) -> tuple[Array, Array]:
        """Return the longest time between two rows of each group, and when it ended for the last time."""
        previous = self.previous(t, before)
        steps = np.where(previous == NONE, 0, t - previous)[self.order]
        found = np.maximum.reduceat(steps, self.starts)
        ended = np.where(steps == np.repeat(found, self.ends - self.starts), t[self.order], NONE)
        return found, np.maximum.reduceat(ended, self.starts)


class LongestGaps:
    """The longest time between two rows, by place, and when it ended."""

    def __init__(self, places: int) -> None:
        self.longest, self.ended = (np.full(places, NONE, np.int64) for _ in range(2))

    def feed(self, groups: Groups, places: Array, t: Array, before: Array) -> None:
        """Take rows at times `t`; `before` are the times of the rows before the first of each group."""
        longest, ended = groups.longest(t, before)
        more = longest > self.longest[places]
        self.longest[places[more]], self.ended[places[more]] = longest[more], ended[more]

    def clear(self) -> None:
        """Forget all of them."""
        self.longest[:] = self.ended[:] = NONE

    def at(self, place: int) -> tuple[int, int]:
        """Return the longest time (0 for none) and its end."""
        return max(0, int(self.longest[place])), int(self.ended[place])


class Slots:
    """Places 0 to `most` - 1 for the first keys that come; all others share place `most`."""

    def __init__(self, most: int) -> None:
        self.most = most
        self.of: dict[int, int] = {}
        self._others: set[int] = set()

    @property
    def beyond(self) -> int:
        """Keys that found no place of their own; counted up to `most` of them."""
        return len(self._others)

    def find(self, groups: Groups) -> Array:
        """Return the places of the keys of groups; those that are new in the order in which they came."""
        if not self.of.keys() >= set(groups.keys):
            for k in np.argsort(groups.order[groups.starts]).tolist():
                self._new(groups.keys[k])
        return np.fromiter((self.of.get(key, self.most) for key in groups.keys), np.int64, len(groups.keys))

    def _new(self, key: int) -> None:
        if key in self.of:
            return
        if len(self.of) < self.most:
            self.of[key] = len(self.of)
        elif len(self._others) < self.most:
            self._others.add(key)
