"""The frames of the recent past, so that a finding can show the bytes that it is about."""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np

from analyzer._native import FrameIndex
from analyzer.rules.joint.session_index import SessionIndex
from analyzer.tables import EXTENDED, FD, REMOTE
from dissectors.kit import NO_TIME, SECOND, SESSION, Kept

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from dissectors.kit import Array, FrameTable

KEPT = 1 << 18
_MOST_REMEMBERED = 1 << 14
_BLOCK = 64
_OFTEN = 256  # questions for numbers, after which all frames of a batch are put in order
MOST_LINES = 16
_LENGTH_CODE = 8  # bits 8 to 11 of the flags
_FD_FLAGS = 4  # BRS and ESI stand in the bits above FD


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
    data: bytes

    def __deepcopy__(self, _memo: object) -> Self:
        """Share it: it never changes."""
        return self

    def text(self, row: int, buses: Sequence[str]) -> str:
        """Return a frame in the form of candump's log files; without a time that part is left out."""
        t, flags, identifier = self.t(row), self.flags(row), self.id(row)
        who = f"{identifier:08X}" if flags & EXTENDED else f"{identifier:03X}"
        if flags & REMOTE:
            code = flags >> _LENGTH_CODE & 0xF
            body = f"#R{code:X}" if code else "#R"
        else:
            data = self.data[self.ends(row) : self.ends(row + 1)].hex().upper()
            body = f"##{flags >> _FD_FLAGS & 3:X}{data}" if flags & FD else f"#{data}"
        when = "" if t == NO_TIME else f"({t // SECOND}.{t % SECOND:09d}) "
        return f"{when}{buses[self.bus(row)]} {who}{body}"


class Recent:
    """Batches of frames that together hold the last `KEPT` frames at least."""

    def __init__(self) -> None:
        self._batches: deque[FrameTable] = deque()
        self._firsts: list[int] = []
        self._cells: list[_Cells | None] = []
        self._held = 0
        self._asked: dict[int, int] = {}  # how often for numbers, by the first frame of a batch
        self._indexes: dict[int, SessionIndex] = {}
        self._natives: dict[int, FrameIndex] = {}
        self._remembered: dict[int, Kept] = {}  # who asks for a frame seldom asks once

    def feed(self, frames: FrameTable) -> None:
        """Add the newest batch; the oldest ones go when nobody can need them."""
        if not len(frames):
            return
        self._batches.append(frames)
        self._firsts.append(frames.first)
        self._cells.append(None)
        self._held += len(frames)
        while self._held - len(self._batches[0]) >= KEPT:
            gone = self._batches.popleft()
            del self._firsts[0], self._cells[0]
            self._held -= len(gone)
            self._asked.pop(gone.first, None)
            self._indexes.pop(gone.first, None)
            self._natives.pop(gone.first, None)

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
        cells = t(row), bus(row), id_(row), flags(row), data[ends(row) : ends(row + 1)], verdict(row)
        found = Kept._make(cells)
        if len(self._remembered) >= _MOST_REMEMBERED:
            self._remembered.clear()
        self._remembered[number] = found
        return found

    def columns(self, numbers: Array) -> tuple[Array, ...]:
        """Return which of some frames are not gone, and their cells: t, bus, id, flags and tail."""
        known = np.zeros(len(numbers), bool)
        cells = tuple(np.zeros(len(numbers), kind) for kind in (np.int64, np.int64, np.int64, np.int64, np.uint8))
        for batch in self._batches:
            mine = np.flatnonzero((numbers >= batch.first) & (numbers < batch.first + len(batch)))
            if len(mine):
                known[mine], rows = True, numbers[mine] - batch.first
                for cell, column in zip(cells, (batch.t, batch.bus, batch.id, batch.flags, batch.tail), strict=True):
                    cell[mine] = column[rows]
        return known, *cells

    def _opened(self, at: int) -> _Cells:
        """Return what gives the cells of a row of a batch."""
        batch = self._batches[at]
        offsets, data = batch.raw
        t, bus, id_, flags, verdict = batch.t, batch.bus, batch.id, batch.flags, batch.verdict
        cells = self._cells[at] = _Cells(
            len(batch), t.item, bus.item, id_.item, flags.item, verdict.item, offsets.item, bytes(data)
        )
        return cells

    def numbers(self, low: int, high: int, bus: int, bits: int, mask: int) -> list[int]:
        """Return the numbers, from `low` to before `high`, of the frames on a bus whose identifiers have these bits."""
        found: list[list[int]] = []
        for batch in reversed(self._batches):
            if batch.first + len(batch) <= low:
                break
            if batch.first < high:
                index = self._index(batch) if mask == SESSION else None
                begin, end = max(low - batch.first, 0), high - batch.first
                if index is not None:
                    found.append((index.rows(begin, end, bus, bits) + batch.first).tolist())
                    continue
                same = (batch.id[begin:end] & mask == bits) & (batch.bus[begin:end] == bus)
                found.append((np.flatnonzero(same) + (begin + batch.first)).tolist())
        return [number for numbers in reversed(found) for number in numbers]

    def indexes(self, low: int, high: int) -> list[FrameIndex]:
        """Return the batches with frames from `low` to before `high` by session, for the core."""
        found = []
        for batch in self._batches:
            if batch.first < high and batch.first + len(batch) > low:
                index = self._natives.get(batch.first)
                if index is None:
                    offsets, data = batch.raw
                    columns = batch.t, batch.bus, batch.id, batch.flags, offsets, np.frombuffer(data, np.uint8)
                    index = self._natives[batch.first] = FrameIndex(batch.first, *columns)
                found.append(index)
        return found

    def _index(self, batch: FrameTable) -> SessionIndex | None:
        """Return the sessions of a batch, as soon as it pays to know them."""
        asked = self._asked[batch.first] = self._asked.get(batch.first, 0) + 1
        if asked >= _OFTEN and batch.first not in self._indexes:
            self._indexes[batch.first] = SessionIndex(batch)
        return self._indexes.get(batch.first)

    def before(self, number: int, most: int, bus: int, bits: int, mask: int) -> Iterator[int]:
        """Yield the same of the `most` frames before one, the last one first."""
        lowest, block = max(number - most, 0), _BLOCK
        for batch in reversed(self._batches):
            start = batch.first
            if start + len(batch) <= lowest:
                break
            low, high = max(lowest - start, 0), min(number - start, len(batch))
            index = self._index(batch) if mask == SESSION and high > 0 else None
            if index is not None:
                yield from (start + row for row in index.before(low, high, bus, bits))
                continue
            while high > low:
                begin = max(high - block, low)
                same = (batch.id[begin:high] & mask == bits) & (batch.bus[begin:high] == bus)
                yield from (start + begin + np.flatnonzero(same)[::-1]).tolist()
                high, block = begin, 4 * block

    def lines(self, wanted: Iterable[int], buses: Sequence[str]) -> tuple[str, ...]:
        """Return frames as `candump -l` writes them, without those that are gone, the first `MOST_LINES`."""
        found: list[str] = []
        for number in wanted:
            at = bisect_right(self._firsts, number) - 1
            cells = (self._cells[at] or self._opened(at)) if at >= 0 else None
            if cells is not None and number - self._firsts[at] < cells.rows:
                found.append(cells.text(number - self._firsts[at], buses))
                if len(found) == MOST_LINES:
                    break
        return tuple(found)
