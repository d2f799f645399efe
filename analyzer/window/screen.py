"""A screen of rows around one of them."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from analyzer.tables import VERDICTS
from analyzer.window.first_frames import first_frames
from analyzer.window.limits import Moment
from analyzer.window.listed import ListedRows
from analyzer.window.selection import NEVER
from dissectors.kit.cells import numbers

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from analyzer.decode.engine import Batch
    from analyzer.window.numbering import Numbering
    from dissectors.kit import Array

    Item = tuple[Batch, ListedRows, int | None]

_FOREIGN = VERDICTS.index("foreign")


class Screen:
    """Keeps so many rows before and behind the one that a window is around: transfers, and frames that form none.

    Args:
        around: number of a frame, or a moment.
        numbering: what that number means.
        rows: to each side.
    """

    def __init__(self, around: int | Moment, numbering: Numbering, rows: int) -> None:
        self._around, self._numbering, self._rows = around, numbering, rows

    def cut(self, items: Iterable[Item]) -> Iterator[Item]:
        """Yield what `ListSelection.picked` gives, with only the rows on the screen."""
        waiting: deque[tuple[Item, Array]] = deque()
        room: int | None = None  # rows still to show, once the middle is there
        for item in items:
            places = _places(item)
            if room is not None:
                if room:
                    yield _within(item, places[:room])
                    room -= len(places[:room])
                continue
            waiting.append((item, places))
            middle = self._middle(item)
            if middle is None:
                self._shorten(waiting)
                continue
            every = np.sort(np.concatenate([some for _, some in waiting]))
            at = int(np.searchsorted(every, middle))
            first = max(at - self._rows, 0)
            room = at - first + 1 + self._rows
            for one, some in waiting:
                shown = some[some >= every[first]][:room] if first < len(every) else some[:0]
                room -= len(shown)
                yield _within(one, shown)
            waiting.clear()

    def _shorten(self, waiting: deque[tuple[Item, Array]]) -> None:
        while sum(len(some) for _, some in waiting) - len(waiting[0][1]) >= self._rows:
            waiting.popleft()

    def _middle(self, item: Item) -> int | None:
        """Return the place of the row in the middle, None if it is not in this batch."""
        batch, picked, zero = item
        first, count = batch.first_frame, len(batch.frames)
        if isinstance(self._around, Moment):
            late = numbers(batch.frames.column("t")) >= (NEVER if zero is None else zero)
            return first + int(np.argmax(late)) if late.any() else None
        if not count or self._around > self._numbering.of(first + count - 1):
            return None
        place = first + int(np.searchsorted(self._numbering.of_all(np.arange(first, first + count)), self._around))
        for frames in batch.transfers.column("frame").take(pa.array(picked.transfers)).to_pylist():
            if place in frames:
                return int(frames[0])
        return place


def _places(item: Item) -> Array:
    """Return where the rows of an item that have lines of their own begin, in order."""
    batch, picked, _ = item
    loose = np.asarray(picked.frames)
    if len(picked.transfers):
        loose = loose[numbers(batch.frames.column("verdict"))[loose] != _FOREIGN]
    starts = first_frames(batch.transfers, picked.transfers)
    return np.sort(np.concatenate((starts, loose.astype(np.int64) + batch.first_frame)))


def _within(item: Item, shown: Array) -> Item:
    """Return an item with the rows from the first place shown to the last one."""
    batch, picked, zero = item
    if not len(shown):
        return batch, ListedRows(*(some[:0] for some in picked)), zero
    low, high = int(shown[0]), int(shown[-1])
    lines = numbers(batch.frames.column("line"))
    of_events = np.searchsorted(lines, numbers(batch.events.column("line"))) if len(batch.events) else np.zeros(0)
    parts = (first_frames(batch.transfers), np.arange(len(batch.frames)) + batch.first_frame)
    places = (*parts, numbers(batch.settled.column("frame")).astype(np.int64), of_events + batch.first_frame)
    kept = (some[(of[some] >= low) & (of[some] <= high)] for of, some in zip(places, picked, strict=True))
    return batch, ListedRows(*kept), zero
