"""Limits of the search for causes, and the causes that are known of a sender whose transfers broke before."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from analyzer.rules.diagnosis.causes import NOT_SEARCHED, Cause

if TYPE_CHECKING:
    from collections.abc import Hashable, Iterable

    from dissectors.kit import Array

LIKE = " (like earlier ones)"
MOST_SEARCHES = 500  # transfers of one type and sender whose cause is searched
MOST_SENDERS = 4096  # of which that is counted
MOST_SHAPES = 64  # of one sender's transfers that are kept apart
_NEARLY_ALL = 0.9
_CODE_BITS, _NODE_BITS = 34, 9

Sender = int  # bus, node and type as one number
Shape = tuple[int, int]  # frames and bytes that came


def senders_of(bus: Array, node: Array, code: Array) -> Array:
    """Return each sender and type as one number; nodes and codes may be -1 for none."""
    who = np.asarray(bus, np.int64) << _NODE_BITS | (np.asarray(node, np.int64) + 1)
    found: Array = who << _CODE_BITS | (np.asarray(code, np.int64) + 1)
    return found


def alike(what: str) -> Cause:
    """Return the cause of a transfer that is told like earlier ones."""
    return Cause(what, "" if what == NOT_SEARCHED else LIKE)


class SearchBudget:
    """Counts searches: what a sender does again and again is told as what was found of it so often."""

    def __init__(self) -> None:
        self._spent: dict[Sender, int] = {}

    def left(self, sender: Sender) -> int:
        """Return how many more searches may be made for a sender and type."""
        spent = self._spent.get(sender)
        if spent is None:
            return MOST_SEARCHES if len(self._spent) < MOST_SENDERS else 0
        return MOST_SEARCHES - spent

    def spend(self, sender: Sender, count: int = 1) -> None:
        """Note searches that were made."""
        self._spent[sender] = self._spent.get(sender, 0) + count

    def allows(self, senders: Array) -> Array:
        """Return a mask of those, in their order, for whom a search may be made."""
        _, first, kind, counts = np.unique(senders, return_index=True, return_inverse=True, return_counts=True)
        left = np.fromiter(map(self.left, senders[first].tolist()), np.int64, len(first))
        order = np.argsort(kind, kind="stable")
        rank = np.empty(len(order), np.int64)
        rank[order] = np.arange(len(order)) - np.repeat(np.cumsum(counts) - counts, counts)
        found: Array = rank < left[kind]
        return found

    def take(self, senders: Array) -> Array:
        """Return the same, and note these searches."""
        found = self.allows(senders)
        for sender, count in Counter(senders[found].tolist()).items():
            if self.left(sender):
                self.spend(sender, count)
            else:  # too many senders
                found &= senders != sender
        return found


class KnownCauses:
    """The causes that were found for each sender, by the shape of its transfers."""

    def __init__(self) -> None:
        self._known: dict[Hashable, dict[Shape | None, dict[str, int]]] = {}

    def note(self, key: Hashable, shape: Shape, cause: str, count: int = 1) -> None:
        """Note one more that was found, or some; an empty cause is one that another finding tells."""
        if key not in self._known and len(self._known) >= MOST_SENDERS:
            return
        known = self._known.setdefault(key, {None: {}})
        known[None][cause] = known[None].get(cause, 0) + count
        if shape in known or len(known) < MOST_SHAPES:
            counts = known.setdefault(shape, {})
            counts[cause] = counts.get(cause, 0) + count

    def note_all(self, found: Iterable[tuple[Hashable, Shape, str]]) -> None:
        """Note many: who sent each, its shape and its cause."""
        for (key, shape, cause), count in Counter(found).items():
            self.note(key, shape, cause, count)

    def like(self, key: Hashable, shape: Shape) -> str:
        """Return the cause of (nearly) all that had this shape, or else of all.

        `NOT_SEARCHED` if there is no such cause.
        """
        known = self._known.get(key)
        if known is None:
            return NOT_SEARCHED
        counts = known.get(shape, known[None])
        cause = max(counts, key=counts.__getitem__)
        return cause if counts[cause] >= _NEARLY_ALL * sum(counts.values()) else NOT_SEARCHED

    def like_all(self, wanted: Iterable[tuple[Hashable, Shape]]) -> list[str]:
        """Return the same for many."""
        known: dict[tuple[Hashable, Shape], str] = {}
        found = []
        for one in wanted:
            if one not in known:
                known[one] = self.like(*one)
            found.append(known[one])
        return found
