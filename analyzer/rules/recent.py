"""The frames of the recent past, so that a finding can show the bytes that it is about."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections import deque
from itertools import groupby
from operator import itemgetter
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np

from analyzer._native import FrameIndex, frame_cells, frame_lines
from analyzer.decode.sent import cells
from dissectors.kit import Kept

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from dissectors.kit import Array, FrameTable

KEPT = 1 << 18
NO_FRAME = (1 << 63) - 1  # the number of a frame that there is not
_MOST_REMEMBERED = 1 << 12  # frames asked for lately: whoever asks again does so soon
MOST_LINES = 16


def soon_gone(frames: FrameTable) -> int:
    """Return the number before which frames may be gone when the batch behind the newest one has come.

    Whoever needs lines of those looks them up now: of all before the newest batch, and of its first ones.
    """
    return min(frames.first, frames.first + len(frames) - KEPT // 4)


class _Cells(NamedTuple):
    """The cells of the rows of a batch: `ends` says where each data field begins in `data`.

    `rows` is how many there are.
    """

    rows: int
    t: Callable[[int], int]
    bus: Callable[[int], int]
    id: Callable[[int], int]
    flags: Callable[[int], int]
    verdict: Callable[[int], int]
    ends: Callable[[int], int]
    data: memoryview

    def __deepcopy__(self, _memo: object) -> Self:
        """Share it: it never changes."""
        return self


class Recent:
    """Batches of frames that together hold the last `KEPT` frames at least, and the batch before the newest one."""

    def __init__(self) -> None:
        self._batches: deque[FrameTable] = deque()
        self._firsts: list[int] = []
        self._cells: list[_Cells | None] = []
        self._held = 0
        self._indexes: list[FrameIndex | None] = []
        self._remembered: dict[int, Kept] = {}  # who asks for a frame seldom asks once

    def feed(self, frames: FrameTable) -> None:
        """Add the newest batch; the oldest ones go when nobody can need them."""
        if not len(frames):
            return
        self._batches.append(frames.bare)
        self._firsts.append(frames.first)
        self._cells.append(None)
        self._indexes.append(None)
        self._held += len(frames)
        while len(self._batches) > 2 and self._held - len(self._batches[0]) >= KEPT:
            gone = self._batches.popleft()
            del self._firsts[0], self._cells[0], self._indexes[0]
            self._held -= len(gone)

    def frame(self, number: int) -> Kept | None:
        """Return a frame by its number, None if it is gone."""
        known = self._remembered.get(number)
        if known is not None:
            return known
        at = bisect_right(self._firsts, number) - 1
        if at < 0:
            return None
        rows, t, bus, id_, flags, verdict, ends, data = self._cells[at] or self._opened(at)
        row = number - self._firsts[at]
        if row >= rows:
            return None
        cells = t(row), bus(row), id_(row), flags(row), bytes(data[ends(row) : ends(row + 1)]), verdict(row)
        found = Kept._make(cells)
        if len(self._remembered) >= _MOST_REMEMBERED:
            self._remembered.clear()
        self._remembered[number] = found
        return found

    def columns(self, numbers: Array) -> tuple[Array, ...]:
        """Return which of some frames are not gone, and their cells: t, bus, id, flags and tail, int64."""
        known, found = frame_cells(self._having(numbers), numbers)
        return cells(known, bool), *(cells(column, np.int64) for column in found)

    def _having(self, numbers: Array) -> list[FrameIndex]:
        """Return the batches that may have some of the frames."""
        return self.indexes(int(numbers.min()), int(numbers.max()) + 1) if len(numbers) else []

    def _opened(self, at: int) -> _Cells:
        """Return what gives the cells of a row of a batch."""
        batch = self._batches[at]
        offsets, data = batch.raw
        t, bus, id_, flags, verdict = batch.t, batch.bus, batch.id, batch.flags, batch.verdict
        cells = self._cells[at] = _Cells(
            len(batch), t.item, bus.item, id_.item, flags.item, verdict.item, offsets.item, data
        )
        return cells

    def indexes(self, low: int, high: int) -> list[FrameIndex]:
        """Return the batches with frames from `low` to before `high` by session, for the core."""
        first, last = max(bisect_right(self._firsts, low) - 1, 0), bisect_left(self._firsts, high)
        if first < last and self._firsts[first] + len(self._batches[first]) <= low:
            first += 1
        some = self._indexes[first:last]
        return [self._native(first + k) if index is None else index for k, index in enumerate(some)]

    def _native(self, at: int) -> FrameIndex:
        """Return a batch as the core has it."""
        index = self._indexes[at]
        if index is None:
            batch = self._batches[at]
            offsets, data = batch.raw
            columns = batch.t, batch.bus, batch.id, batch.flags, offsets, np.frombuffer(data, np.uint8)
            index = self._indexes[at] = FrameIndex(batch.first, *columns)
        return index

    def lines(self, wanted: Iterable[int], buses: Sequence[str]) -> tuple[str, ...]:
        """Return frames as `candump -l` writes them, without those that are gone, the first `MOST_LINES`."""
        numbers = list(wanted)
        if not numbers or not self._firsts:
            return ()
        if min(numbers) >= self._firsts[-1]:  # mostly all are of the newest batch
            return self._lines(-1, numbers, buses)
        places = [bisect_right(self._firsts, number) - 1 for number in numbers]
        if places.count(places[0]) == len(places):
            return self._lines(places[0], numbers, buses) if places[0] >= 0 else ()
        found: list[str] = []
        for at, some in groupby(zip(places, numbers, strict=True), itemgetter(0)):
            found += self._lines(at, [number for _, number in some], buses) if at >= 0 else ()
            if len(found) >= MOST_LINES:
                break
        return tuple(found[:MOST_LINES])

    def each_line(self, numbers: Array, buses: Sequence[str]) -> Array:
        """Return many frames as `candump -l` writes them, one text each: an empty one for those that are gone."""
        return np.array(frame_lines(self._having(numbers), numbers, buses), object)

    def _lines(self, at: int, numbers: list[int], buses: Sequence[str]) -> tuple[str, ...]:
        """Return frames of one batch."""
        index = self._indexes[at]
        return tuple((self._native(at) if index is None else index).lines(numbers[:MOST_LINES], buses))
