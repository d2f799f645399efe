"""The starts of transfers in a session whose counter broke, in the order in which they came, finished or not.

Transfers are told in the order of their ends, and what never ends is told late; only the starts say who counted how.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.rules.recent import KEPT
from analyzer.tables import ERROR, EXTENDED, REMOTE, TAIL_END, TAIL_ID, TAIL_START, TRANSFER_IDS

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, FrameTable, View

_SESSION = 0xFF_FFFF  # bits of an identifier: all but the priority


class OddStart(NamedTuple):
    """A start whose transfer ID is not that of the one before it plus 1; `since` is the time of that one.

    `again` says that it may only begin that one again, which did not end.
    """

    number: int
    t: int
    before: int
    transfer_id: int
    since: int
    again: bool = False

    @property
    def step(self) -> int:
        """Return how far it counted, 0 to 31."""
        return (self.transfer_id - self.before) % TRANSFER_IDS


class LatestFrames:
    """The last batches of frames, for sessions that turn out to be worth a look."""

    def __init__(self) -> None:
        self._batches: deque[FrameTable] = deque()
        self._held = 0

    def feed(self, view: View) -> None:
        """Add the newest batch."""
        if not len(view.frames):
            return
        self._batches.append(view.frames)
        self._held += len(view.frames)
        while self._held - len(self._batches[0]) >= KEPT:
            self._held -= len(self._batches.popleft())

    def since(self, number: int) -> Iterator[FrameTable]:
        """Yield the batches that hold a frame and what came after it."""
        for frames in self._batches:
            if frames.first + len(frames) > number:
                yield frames


class _Frames(NamedTuple):
    """Frames of a session: rows of their batch, and tail bytes."""

    row: Array
    tail: Array


class SessionStarts:
    """Follows one session.

    Args:
        session: bus above 32 bits of the identifier.
        start: the start behind which it begins.
        data: its frame.
    """

    def __init__(self, session: int, start: OddStart, data: bytes) -> None:
        self._bus, self._bits = session >> 32, session & _SESSION
        self._next = start.number + 1
        self._waiting: deque[OddStart] = deque()
        self._latest = start.transfer_id, start.t
        self._data = data
        self._ended = bool(data[-1] & TAIL_END)

    def until(self, number: int, latest: LatestFrames) -> Iterator[OddStart]:
        """Yield the odd starts that were not told yet, up to a frame."""
        if number >= self._next:
            for frames in latest.since(self._next):
                self._read(frames)
                self._next = frames.first + len(frames)
        while self._waiting and self._waiting[0].number <= number:
            yield self._waiting.popleft()

    def _read(self, frames: FrameTable) -> None:
        """Take what is new in a batch."""
        row, tail = self._own(frames)
        begins = np.flatnonzero(tail & TAIL_START)
        ids = np.concatenate(((self._latest[0],), tail[begins] & TAIL_ID)).astype(np.int64)
        times = np.concatenate(((self._latest[1],), frames.t[row[begins]]))
        borders = [0, *begins.tolist(), len(tail)]
        for k in np.flatnonzero(np.diff(ids) % TRANSFER_IDS != 1).tolist():
            at, same = int(row[begins[k]]), ids[k] == ids[k + 1]
            if same and frames.data(at) == (frames.data(int(row[begins[k - 1]])) if k else self._data):
                continue  # a copy
            again = bool(same) and not self._is_over(int(ids[k]), tail[borders[k] : borders[k + 1]], known=not k)
            start = OddStart(frames.first + at, int(times[k + 1]), int(ids[k]), int(ids[k + 1]), int(times[k]), again)
            self._waiting.append(start)
        self._ended = self._is_over(int(ids[-1]), tail[borders[-2] :], known=not len(begins))
        self._latest = int(ids[-1]), int(times[-1])
        if len(begins):
            self._data = frames.data(int(row[begins[-1]]))

    def _own(self, frames: FrameTable) -> tuple[Array, Array]:
        """Return the rows of the session's frames that are new, and their tail bytes."""
        new = slice(max(self._next - frames.first, 0), None)
        mine = (frames.id[new] & _SESSION == self._bits) & (frames.bus[new] == self._bus)
        row = np.flatnonzero(mine & (frames.flags[new] & (EXTENDED | REMOTE | ERROR) == EXTENDED)) + new.start
        row = row[frames.length[row] > 0]
        offsets, data = frames.raw
        return row, np.frombuffer(data, np.uint8)[offsets[row + 1] - 1]

    def _is_over(self, transfer_id: int, tails: Array, *, known: bool) -> bool:
        """Return whether a transfer ends in one of these frames; `known` if it may have ended in an earlier batch."""
        ends = tails & (TAIL_END | TAIL_ID) == TAIL_END | transfer_id
        return bool(ends.any()) or (known and self._ended)
