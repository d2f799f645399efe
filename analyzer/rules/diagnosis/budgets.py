"""Limits of the search for causes, and the causes that are known of a sender whose transfers broke before."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from analyzer._native import Budget, Causes
from analyzer.decode.sent import cells
from analyzer.rules.diagnosis.causes import FORMS, GONE, NOT_SEARCHED, NOTED, Cause
from analyzer.rules.diagnosis.checksums import CORRUPTED, DOUBTFUL

if TYPE_CHECKING:
    from dissectors.kit import Array

LIKE = " (like earlier ones)"
MOST_SEARCHES = 500  # transfers of one type and sender whose cause is searched
MOST_SENDERS = 4096  # of which that is counted
MOST_SHAPES = 63  # of one sender's transfers that are kept apart
# Words of causes by number: those of the core's forms, an empty one is told by another finding.
WHATS = (*(form.what for form in FORMS), CORRUPTED, DOUBTFUL)
NUMBERS = {what: WHATS.index(what) for what in WHATS}
IS_NOTED = np.array([what in NOTED for what in WHATS])
_NEARLY_ALL = 0.9
_AT_ONCE = 256  # causes noted one by one that the core takes together; more wait longer than it is worth
_CODE_BITS, _NODE_BITS = 34, 9
_FRAMES_BIT = 32  # above the bytes in a shape


def senders_of(bus: int | Array, node: int | Array, code: int | Array) -> Array:
    """Return each sender and type as one number; nodes and codes may be -1 for none."""
    bus, node, code = (np.asarray(one, np.int64) for one in (bus, node, code))
    found: Array = _sender(bus, node, code)
    return found


def _sender(bus: Any, node: Any, code: Any) -> Any:
    return (bus << _NODE_BITS | node + 1) << _CODE_BITS | code + 1


def shapes_of(frames: int | Array, received: int | Array) -> Array:
    """Return frames and bytes that came of each transfer as one number."""
    found: Array = np.asarray(frames, np.int64) << _FRAMES_BIT | received
    return found


def alike(what: str) -> Cause:
    """Return the cause of a transfer that is told like earlier ones."""
    return Cause(what, "" if what == NOT_SEARCHED else LIKE)


class SearchBudget:
    """Counts searches: what a sender does again and again is told as what was found of it so often."""

    def __init__(self) -> None:
        self._spent = Budget(MOST_SEARCHES, MOST_SENDERS)

    def left(self, sender: int) -> int:
        """Return how many more searches may be made for a sender and type."""
        return self._spent.left(sender)

    def spend(self, sender: int) -> None:
        """Note a search that was made."""
        self._spent.spend(sender)

    def allows(self, senders: Array) -> Array:
        """Return a mask of those, in their order, for whom a search may be made."""
        return cells(self._spent.allows(senders), bool)

    def take(self, senders: Array) -> Array:
        """Return the same, and note these searches; of senders beyond those that are counted none is made."""
        return cells(self._spent.take(senders), bool)


class KnownCauses:
    """The causes that were found for each sender, by the shape of its transfers.

    Senders and shapes are numbers as `senders_of` and `shapes_of` give them, causes are `NUMBERS`.
    """

    def __init__(self) -> None:
        self._known = Causes(MOST_SENDERS, MOST_SHAPES)
        self._new: list[tuple[int, int, int]] = []  # noted one by one since

    def note(self, source: tuple[int, int, int], frames: int, received: int, what: str) -> None:
        """Note a cause by its words, of one transfer: bus, node and type, frames and bytes that came."""
        self._new.append((_sender(*source), frames << _FRAMES_BIT | received, NUMBERS[what]))
        if len(self._new) >= _AT_ONCE:
            self._settle()

    def note_all(self, senders: Array, shapes: Array, causes: Array) -> None:
        """Note many that were found."""
        self._settle()
        self._known.note(senders, shapes, causes.astype(np.int64))

    def _settle(self) -> None:
        if self._new:
            self._known.note(*np.array(self._new, np.int64).T.copy())
            self._new.clear()

    def like_all(self, senders: Array, shapes: Array) -> Array:
        """Return the cause of (nearly) all of each sender that had this shape, or else of all.

        That of `NOT_SEARCHED` if there is no such cause.
        """
        self._settle()
        return cells(self._known.like(senders, shapes, _NEARLY_ALL, GONE), np.int64)
