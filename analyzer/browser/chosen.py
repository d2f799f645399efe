"""The rows that a display filter has chosen so far: found segment by segment by a thread, while the list is shown."""

from __future__ import annotations

import threading
from bisect import bisect_right
from typing import TYPE_CHECKING, Protocol

import numpy as np

from analyzer.browser.store.order import EVENT, FRAME, SETTLED, TRANSFER, split
from analyzer.browser.store.segment import OpenSegment

if TYPE_CHECKING:
    from collections.abc import Callable

    from analyzer.browser.store.store import Store
    from analyzer.filter.matcher import Matcher
    from dissectors.kit import Array

_PAUSE = 0.05  # seconds until it is looked for another segment


class RowSet(Protocol):
    """Rows in the order of the capture."""

    def __len__(self) -> int:
        """Count those that are known."""

    def at(self, number: int) -> tuple[int, int]:
        """Return segment and place in it of a row, by its number among these."""

    def find(self, segment: int, local: int) -> int:
        """Return the number of a row, of the next one if it is not among these."""


class AllRows:
    """All rows of a store."""

    def __init__(self, store: Store) -> None:
        self._store = store

    def __len__(self) -> int:
        """Count those that are there."""
        return len(self._store)

    def at(self, number: int) -> tuple[int, int]:
        """Return segment and place in it of a row."""
        return self._store.locate(number)

    def find(self, segment: int, local: int) -> int:
        """Return the number of a row."""
        return self._store.starts[segment] + local


class ChosenRows:
    """Rows that a filter selects. `look` works in a thread of its own until it is stopped.

    Args:
        store: what is there, and still grows until `ended` says so.
        matcher: of the filter, new.
    """

    def __init__(self, store: Store, matcher: Matcher, ended: Callable[[], bool]) -> None:
        self._store, self._matcher, self._ended = store, matcher, ended
        self._found: list[Array] = []
        self._starts = [0]
        self._stop = threading.Event()
        self.done = False
        self.problem: Exception | None = None

    def start(self) -> None:
        """Begin to look."""
        threading.Thread(target=self.look, name="filter", daemon=True).start()

    def stop(self) -> None:
        """Look no further."""
        self._stop.set()

    def look(self) -> None:
        """Look through all segments, and those that come."""
        try:
            while not self._stop.is_set():
                ended = self._ended()
                while len(self._found) < len(self._store.segments) and not self._stop.is_set():
                    self._take(matching_rows(self._store, len(self._found), self._matcher))
                if ended:
                    break
                self._stop.wait(_PAUSE)
        except Exception as error:  # noqa: BLE001 - the list has to say it
            self.problem = error
        self.done = True

    def _take(self, rows: Array) -> None:
        self._starts.append(self._starts[-1] + len(rows))
        self._found.append(rows)

    @property
    def share(self) -> float:
        """How much of what is there it has looked through, from 0 to 1."""
        return len(self._found) / max(1, len(self._store.segments))

    def __len__(self) -> int:
        """Count those that are found."""
        return self._starts[len(self._found)]

    def at(self, number: int) -> tuple[int, int]:
        """Return segment and place in it of a row."""
        at = bisect_right(self._starts, number, hi=len(self._found) + 1) - 1
        return at, int(self._found[at][number - self._starts[at]])

    def find(self, segment: int, local: int) -> int:
        """Return the number of a row, of the next one if it is not among these."""
        if segment >= len(self._found):
            return len(self)
        return self._starts[segment] + int(np.searchsorted(self._found[segment], local))


def matching_rows(store: Store, at: int, matcher: Matcher) -> Array:
    """Return the places in the list of a segment that a filter selects, ascending (u32)."""
    opened = OpenSegment(store.segments[at])
    kinds, index = split(opened.column("rows", "key"))
    if not len(kinds):
        matcher.feed(opened.batch)
        return np.zeros(0, np.uint32)
    matches = matcher.feed(opened.batch)
    holds = np.zeros(len(kinds), bool)
    for kind in (TRANSFER, FRAME, SETTLED, EVENT):
        of = kinds == kind
        if not of.any():
            continue
        some = index[of]
        if kind == FRAME:
            holds[of] = matches.loose(some)
        else:
            mask = {TRANSFER: "transfers", SETTLED: "settled", EVENT: "events"}[kind]
            holds[of] = getattr(matches, mask)[some]
    return np.flatnonzero(holds).astype(np.uint32)
