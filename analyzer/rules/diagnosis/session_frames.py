"""The last frames of a session, found without a look at each of them."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dissectors.kit import Array, Kept, View

HELD = 1 << 15  # frames at least; older ones are looked at one by one
_SESSION = 0xFF_FFFF  # bits of an identifier: all but the priority


class SessionFrames:
    """The identifiers and buses of the last batches."""

    def __init__(self) -> None:
        self._batches: deque[tuple[int, Array, Array]] = deque()  # the first frame, its and the others' columns
        self._held = 0

    def feed(self, view: View) -> None:
        """Add the newest batch."""
        f = view.frames
        if not len(f):
            return
        self._batches.append((f.first, f.id, f.bus))
        self._held += len(f)
        while self._held - len(self._batches[0][1]) >= HELD:
            self._held -= len(self._batches.popleft()[1])

    def numbers(self, view: View, low: int, high: int, like: Kept) -> Sequence[int]:
        """Return frames from `low` to before `high` on the bus of a frame with its identifier, but for the priority."""
        wanted = like.id & _SESSION
        found: list[int] = []
        begin = self._batches[0][0] if self._batches else high
        for number in range(low, min(begin, high)):
            kept = view.frame(number)
            if kept is not None and kept.bus == like.bus and kept.id & _SESSION == wanted:
                found.append(number)
        behind: list[list[int]] = []
        for first, ids, buses in reversed(self._batches):
            if first + len(ids) <= low:
                break
            if first < high:
                rows = slice(max(low - first, 0), high - first)
                same = (ids[rows] & _SESSION == wanted) & (buses[rows] == like.bus)
                behind.append((np.flatnonzero(same) + max(low, first)).tolist())
        return [*found, *(number for batch in reversed(behind) for number in batch)]
