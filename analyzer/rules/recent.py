"""The frames of the recent past, so that a finding can show the bytes that it is about."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from analyzer.rules.joint.session_index import SessionIndex
from analyzer.tables import EXTENDED, FD, REMOTE
from dissectors.kit import NO_TIME, SECOND, SESSION, Kept

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from dissectors.kit import FrameTable

KEPT = 1 << 18
_MOST_REMEMBERED = 1 << 16
_BLOCK = 64
_OFTEN = 256  # questions for numbers, after which all frames of a batch are put in order
MOST_LINES = 16
_LENGTH_CODE = 8  # bits 8 to 11 of the flags
_FD_FLAGS = 4  # BRS and ESI stand in the bits above FD


class Recent:
    """Batches of frames that together hold the last `KEPT` frames at least."""

    def __init__(self) -> None:
        self._batches: deque[FrameTable] = deque()
        self._held = 0
        self._asked: dict[int, int] = {}  # how often for numbers, by the first frame of a batch
        self._indexes: dict[int, SessionIndex] = {}
        self._remembered: dict[int, Kept] = {}  # who asks for a frame seldom asks once

    def feed(self, frames: FrameTable) -> None:
        """Add the newest batch; the oldest ones go when nobody can need them."""
        if not len(frames):
            return
        self._batches.append(frames)
        self._held += len(frames)
        while self._held - len(self._batches[0]) >= KEPT:
            gone = self._batches.popleft()
            self._held -= len(gone)
            self._asked.pop(gone.first, None)
            self._indexes.pop(gone.first, None)

    def frame(self, number: int) -> Kept | None:
        """Return a frame by its number, None if it is gone."""
        known = self._remembered.get(number)
        if known is not None:
            return known
        at = self._batch_of(number)
        if at < 0:
            return None
        batch = self._batches[at]
        row = number - batch.first
        if row >= len(batch):
            return None
        found = Kept(
            batch.t.item(row), batch.bus.item(row), batch.id.item(row), batch.flags.item(row), batch.data(row),
            batch.verdict.item(row),
        )  # fmt: skip
        if len(self._remembered) >= _MOST_REMEMBERED:
            self._remembered.clear()
        self._remembered[number] = found
        return found

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

    def _index(self, batch: FrameTable) -> SessionIndex | None:
        """Return the sessions of a batch, as soon as it pays to know them."""
        asked = self._asked[batch.first] = self._asked.get(batch.first, 0) + 1
        if asked >= _OFTEN and batch.first not in self._indexes:
            self._indexes[batch.first] = SessionIndex(batch)
        return self._indexes.get(batch.first)

    def before(self, number: int, most: int, bus: int, bits: int, mask: int) -> Iterator[int]:
        """Yield the same of the `most` frames before one, the last one first."""
        high, lowest, block = number, max(number - most, 0), _BLOCK
        while high > lowest:
            low = max(high - block, lowest)
            yield from reversed(self.numbers(low, high, bus, bits, mask))
            high, block = low, 4 * block

    def _batch_of(self, number: int) -> int:
        """Return which batch begins with this frame or before it, -1 if none does."""
        low, high = 0, len(self._batches)
        while low < high:
            middle = (low + high) // 2
            if self._batches[middle].first <= number:
                low = middle + 1
            else:
                high = middle
        return low - 1

    def lines(self, wanted: Iterable[int], buses: Sequence[str]) -> tuple[str, ...]:
        """Return frames as `candump -l` writes them, without those that are gone, the first `MOST_LINES`."""
        found = []
        for number in wanted:
            kept = self.frame(number)
            if kept is not None:
                found.append(text(kept, buses[kept.bus]))
            if len(found) == MOST_LINES:
                break
        return tuple(found)


def text(frame: Kept, bus: str) -> str:
    """Return one frame in the form of candump's log files; without a time that part is left out."""
    wide = 8 if frame.flags & EXTENDED else 3
    if frame.flags & REMOTE:
        code = frame.flags >> _LENGTH_CODE & 0xF
        body = f"#R{code:X}" if code else "#R"
    elif frame.flags & FD:
        body = f"##{frame.flags >> _FD_FLAGS & 3:X}{frame.data.hex().upper()}"
    else:
        body = f"#{frame.data.hex().upper()}"
    when = "" if frame.t == NO_TIME else f"({frame.t // SECOND}.{frame.t % SECOND:09d}) "
    return f"{when}{bus} {frame.id:0{wide}X}{body}"
