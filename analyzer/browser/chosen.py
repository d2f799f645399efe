"""The rows that a display filter has chosen so far: found segment by segment by a thread, while the list is shown."""

from __future__ import annotations

import threading
import time
from bisect import bisect_right
from typing import TYPE_CHECKING, Protocol

import numpy as np

from analyzer.browser.store.order import EVENT, FRAME, SETTLED, TRANSFER, split
from analyzer.browser.store.segment import OpenSegment

if TYPE_CHECKING:
    from collections.abc import Callable

    from analyzer.browser.store.store import TableStore
    from analyzer.filter.matcher import Matcher
    from dissectors.kit import Array

_PAUSE = 0.05  # seconds until it is looked for another segment
_SHARE = 5  # times as long as it took it is waited until everything is looked through anew


class OrderedRows(Protocol):
    """Rows in the order of the capture."""

    def __len__(self) -> int:
        """Count those that are known."""

    def at(self, number: int) -> tuple[int, int]:
        """Return segment and place in it of a row, by its number among these."""

    def find(self, segment: int, local: int) -> int:
        """Return the number of a row, of the next one if it is not among these."""

    def inside(self, segment: int) -> Array:
        """Return the places of rows in the list of a segment, ascending."""


class AllRows:
    """All rows of a store."""

    def __init__(self, store: TableStore) -> None:
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

    def inside(self, segment: int) -> Array:
        """Return the places of rows in the list of a segment."""
        return np.arange(self._store.segments[segment].rows, dtype=np.uint32)


class ChosenRows:
    """Rows that a filter selects. `look` works in a thread of its own until it is stopped.

    Args:
        store: what is there, and still grows until `ended` says so.
        matcher: makes the filter anew, each time for all that is there.
        revision: is another one when rows may be selected that were not before, and the other way round.
    """

    def __init__(
        self, store: TableStore, matcher: Callable[[], Matcher], ended: Callable[[], bool],
        revision: Callable[[], int] = lambda: 0,
    ) -> None:  # fmt: skip
        self._store, self._ended, self._new, self._revision = store, ended, matcher, revision
        self._matcher = matcher()
        self._known: tuple[list[Array], list[int]] = [], [0]
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
        """Look through all segments, and those that come; and anew through all when more is known of them."""
        try:
            seen, due = self._revision(), 0.0
            while not self._stop.is_set():
                ended, now = self._ended(), self._revision()
                self._through(self._matcher, *self._known, len(self._store.segments))
                if now != seen and (ended or time.monotonic() >= due):
                    seen, begun = now, time.monotonic()
                    self._anew()
                    due = time.monotonic() + _SHARE * (time.monotonic() - begun)
                if ended and self._revision() == seen:
                    break
                self._stop.wait(_PAUSE)
        except Exception as error:  # noqa: BLE001 - the list has to say it
            self.problem = error
        self.done = True

    def _through(self, matcher: Matcher, found: list[Array], starts: list[int], end: int) -> None:
        while len(found) < end and not self._stop.is_set():
            rows = matching_rows(self._store, len(found), matcher)
            starts.append(starts[-1] + len(rows))
            found.append(rows)

    def _anew(self) -> None:
        """Look through everything once more, in place of what is known."""
        matcher = self._new()
        found: list[Array] = []
        starts = [0]
        self._through(matcher, found, starts, len(self._known[0]))
        if not self._stop.is_set():
            self._matcher, self._known = matcher, (found, starts)

    @property
    def share(self) -> float:
        """How much of what is there it has looked through, from 0 to 1."""
        return len(self._known[0]) / max(1, len(self._store.segments))

    def __len__(self) -> int:
        """Count those that are found."""
        found, starts = self._known
        return starts[len(found)]

    def at(self, number: int) -> tuple[int, int]:
        """Return segment and place in it of a row."""
        found, starts = self._known
        number = min(number, starts[len(found)] - 1)  # what was looked through anew may be less
        if number < 0:
            return 0, 0
        at = bisect_right(starts, number, hi=len(found) + 1) - 1
        return at, int(found[at][number - starts[at]])

    def find(self, segment: int, local: int) -> int:
        """Return the number of a row, of the next one if it is not among these."""
        found, starts = self._known
        if segment >= len(found):
            return starts[len(found)]
        return starts[segment] + int(np.searchsorted(found[segment], local))

    def inside(self, segment: int) -> Array:
        """Return the places of rows in the list of a segment, ascending."""
        found, _ = self._known
        return found[segment] if segment < len(found) else np.zeros(0, np.uint32)


def matching_rows(store: TableStore, at: int, matcher: Matcher) -> Array:
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
