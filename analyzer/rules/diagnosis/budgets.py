"""Limits of the search for causes, and the causes that are known of a sender whose transfers broke before."""

from __future__ import annotations

from collections import Counter

NOT_SEARCHED = "further ones, cause not sought"
LIKE = " (like earlier ones)"
MOST_SEARCHES = 500  # transfers of one type and sender whose cause is searched
AT_ONCE = 4000  # of all, wherever they are, and one more in every so many frames of the capture:
EACH = 2048
FEW = 8  # of a sender; a share of all is kept for those that had fewer:
SHARE = 4
MOST_SENDERS = 4096  # of which that is counted
MOST_SHAPES = 64  # of one sender's transfers that are kept apart
_NEARLY_ALL = 0.9

Sender = tuple[int, int, int]  # bus, node, type
Shape = tuple[int, int]  # frames and bytes that came


class SearchBudget:
    """Counts searches, so that a capture whose every transfer is broken costs no more than a share of its frames."""

    def __init__(self) -> None:
        self._spent: dict[Sender, int] = {}
        self._total = 0

    def take(self, key: Sender, number: int) -> bool:
        """Return whether one more search may be made for a sender and type, at a frame of this number."""
        spent = self._spent.get(key, MOST_SEARCHES if len(self._spent) >= MOST_SENDERS else 0)
        most = AT_ONCE + number // EACH
        if spent >= MOST_SEARCHES or self._total >= (most if spent < FEW else most - most // SHARE):
            return False
        self._spent[key] = spent + 1
        self._total += 1
        return True


class KnownCauses:
    """The causes that were found for each sender, by the shape of its transfers."""

    def __init__(self) -> None:
        self._known: dict[Sender, dict[Shape | None, Counter[str]]] = {}

    def note(self, key: Sender, shape: Shape, cause: str) -> None:
        """Note one more that was found; an empty cause is one that another finding tells."""
        if key not in self._known and len(self._known) >= MOST_SENDERS:
            return
        known = self._known.setdefault(key, {None: Counter()})
        known[None][cause] += 1
        if shape in known or len(known) < MOST_SHAPES:
            known.setdefault(shape, Counter())[cause] += 1

    def like(self, key: Sender, shape: Shape) -> str:
        """Return the cause of (nearly) all that had this shape, or else of all.

        `NOT_SEARCHED` if there is no such cause.
        """
        known = self._known.get(key)
        if known is None:
            return NOT_SEARCHED
        counts = known.get(shape, known[None])
        cause, count = counts.most_common(1)[0]
        return cause if count >= _NEARLY_ALL * counts.total() else NOT_SEARCHED
