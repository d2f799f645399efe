"""Frames that were there before: a piece of a capture that comes again is a tool's or an attacker's, and no loss."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from analyzer.tables import TAIL_ID, TRANSFER_IDS
from dissectors.kit import SECOND

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator

    from analyzer.rules.joint.lacks import Lack
    from dissectors.kit import Array, FrameTable

LOOK = 1 << 15  # frames before one among which it may have been before
_HELD = 1 << 17  # frames at least; what is older is not looked for
_NEAR = SECOND  # so far apart is what the same piece of a capture does to sessions
_FEW = 8  # frames in a row may have the same bytes before the tail: an uptime, for one
_NEW, _SEEN, _ONCE = 0, 1, 2  # what a frame is: _ONCE if it came once before, and few others had these bytes


class Repeats:
    """The last frames of all buses."""

    def __init__(self) -> None:
        self._batches: deque[FrameTable] = deque()
        self._held = 0
        self._found: dict[int, int] = {}

    def feed(self, frames: FrameTable) -> None:
        """Add the newest batch."""
        if not len(frames):
            return
        self._batches.append(frames)
        self._held += len(frames)
        while self._held - len(self._batches[0]) >= _HELD:
            self._held -= len(self._batches.popleft())
        gone = [number for number in self._found if number < self._batches[0].first]
        for number in gone:
            del self._found[number]

    def among(self, lacks: Collection[Lack]) -> set[Lack]:
        """Return where nothing is missing, because frames came again or went on behind those.

        Bytes that come by themselves each time an ID comes round show that only beside others. One session is enough
        if no other one shows new bytes.
        """
        kinds = {one: self._kind(one) for one in lacks}
        order = sorted(kinds, key=lambda one: one.until)
        times = np.array([one.until for one in order], np.int64)
        found: set[Lack] = set()
        for one, kind in kinds.items():
            first, last = np.searchsorted(times, (one.until - _NEAR, one.until + _NEAR + 1)).tolist()
            near = order[first:last] if kind != _NEW else []
            sure = {each.session for each in near if kinds[each] == _ONCE}
            if len(sure) > 1 or (sure and all(self._of(each.frames[1]) != _NEW for each in near)):
                found.add(one)
        return found

    def _kind(self, one: Lack) -> int:
        return max(self._of(number) for number in (*one.frames, one.left) if number is not None)

    def _of(self, number: int) -> int:
        """Return what a frame is."""
        if number not in self._found:
            self._found[number] = self._search(number)
        return self._found[number]

    def _search(self, number: int) -> int:
        home = next((frames for frames in self._batches if 0 <= number - frames.first < len(frames)), None)
        if home is None:
            return _NEW
        data = home.data(number - home.first)
        tails = np.concatenate([np.empty(0, np.uint8), *self._like(home, number, data)])
        again = int(np.count_nonzero(tails == data[-1])) if data else 0
        if not again:
            return _NEW
        ids = np.unique(tails & TAIL_ID).astype(np.int64)
        breaks = np.count_nonzero(np.diff(ids, append=ids[0] + TRANSFER_IDS) != 1)
        in_a_row = len(ids) == len(tails) <= _FEW and breaks <= 1
        return _ONCE if again == 1 and in_a_row else _SEEN

    def _like(self, home: FrameTable, number: int, data: bytes) -> Iterator[Array]:
        """Yield the tail bytes of frames before one that have its identifier and its other bytes."""
        row = number - home.first
        for frames in self._batches:
            part = slice(max(number - LOOK - frames.first, 0), max(number - frames.first, 0))
            same = (frames.id[part] == home.id[row]) & (frames.bus[part] == home.bus[row])
            rows = np.flatnonzero(same & (frames.length[part] == len(data))) + part.start
            if len(rows) and data:
                ends, raw = frames.raw
                whole = np.frombuffer(raw, np.uint8)[ends[rows][:, None] + np.arange(len(data))]
                yield whole[(whole[:, :-1] == np.frombuffer(data[:-1], np.uint8)).all(axis=1), -1]
