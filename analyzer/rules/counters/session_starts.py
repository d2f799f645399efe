"""The starts of transfers in a session whose counter broke, in the order in which they came, finished or not.

Transfers are told in the order of their ends, and what never ends is told late; only the starts say who counted how.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.rules.recent import KEPT
from analyzer.tables import ERROR, EXTENDED, REMOTE, TAIL_END, TAIL_ID, TAIL_START, TRANSFER_IDS
from dissectors.kit import SESSION

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, FrameTable, View

_MOST_MADE = 1024  # starts at once


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


class _Columns(NamedTuple):
    """Odd starts in columns: a batch may have very many."""

    number: Array
    t: Array
    before: Array
    transfer_id: Array
    since: Array
    again: Array

    def starts(self) -> Iterator[OddStart]:
        """Yield them."""
        yield from map(OddStart._make, zip(*(column.tolist() for column in self), strict=True))


class SessionStarts:
    """Follows one session.

    Args:
        session: bus above 32 bits of the identifier.
        start: the start behind which it begins.
        data: its frame.
    """

    def __init__(self, session: int, start: OddStart, data: bytes) -> None:
        self._bus, self._bits = session >> 32, session & SESSION
        self._next = start.number + 1
        self._waiting: deque[OddStart] = deque()
        self._read_ahead: deque[_Columns] = deque()
        self._latest = start.transfer_id, start.t
        self._data = data
        self._ended = bool(data[-1] & TAIL_END)

    def until(self, number: int, view: View, latest: LatestFrames) -> Iterator[OddStart]:
        """Yield the odd starts that were not told yet, up to a frame."""
        if number >= self._next:
            for frames in latest.since(self._next):
                self._read(view, frames)
                self._next = frames.first + len(frames)
        while self._waiting or self._read_ahead:
            if not self._waiting:
                self._waiting.extend(self._read_ahead.popleft().starts())
            if self._waiting[0].number > number:
                return
            yield self._waiting.popleft()

    def _read(self, view: View, frames: FrameTable) -> None:
        """Take what is new in a batch."""
        row, tail = self._own(view, frames)
        if not len(row):
            return
        begins = np.flatnonzero(tail & TAIL_START)
        ids = np.concatenate(((self._latest[0],), tail[begins] & TAIL_ID)).astype(np.int64)
        times = np.concatenate(((self._latest[1],), frames.t[row[begins]]))
        odd = np.flatnonzero((ids[1:] - ids[:-1]) % TRANSFER_IDS != 1)
        if len(odd):
            again = ids[odd] == ids[odd + 1]
            if again.any():
                copies = np.zeros(len(odd), bool)
                copies[again] = self._alike(frames, row[begins], odd[again])
                again &= ~self._over(ids, begins, tail)[odd]
                odd, again = odd[~copies], again[~copies]
            columns = row[begins[odd]] + frames.first, times[odd + 1], ids[odd], ids[odd + 1], times[odd], again
            for first in range(0, len(odd), _MOST_MADE):
                self._read_ahead.append(_Columns(*(column[first : first + _MOST_MADE] for column in columns)))
        last = tail[begins[-1] :] if len(begins) else tail
        ends = bool((last & (TAIL_END | TAIL_ID) == TAIL_END | int(ids[-1])).any())
        self._ended = ends or (self._ended and not len(begins))
        self._latest = int(ids[-1]), int(times[-1])
        if len(begins):
            self._data = frames.data(int(row[begins[-1]]))

    def _over(self, ids: Array, begins: Array, tail: Array) -> Array:
        """Return of each start whether its transfer ends before the next; the first is that before the batch."""
        which = np.zeros(len(tail), np.int64)
        which[begins] = 1
        which = np.cumsum(which)
        over = np.zeros(len(ids), bool)
        over[which[tail & (TAIL_END | TAIL_ID) == TAIL_END | ids[which]]] = True
        over[0] |= self._ended
        return over

    def _alike(self, frames: FrameTable, starts: Array, places: Array) -> Array:
        """Return of places of starts whether the first frames there have the same bytes as those of the ones before."""
        found = np.zeros(len(places), bool)
        behind = places > 0
        if len(places) and not behind[0]:
            found[0] = frames.data(int(starts[0])) == self._data
        here, past = starts[places[behind]], starts[places[behind] - 1]
        offsets, data = frames.raw
        size = frames.length[here]
        same = size == frames.length[past]
        raw, at = np.frombuffer(data, np.uint8), np.arange(int(size.max(initial=0)))
        mine, others = (raw.take(offsets[rows].astype(np.int64)[:, None] + at, mode="clip") for rows in (here, past))
        found[behind] = same & ((mine == others) | (at >= size[:, None])).all(axis=1)
        return found

    def _own(self, view: View, frames: FrameTable) -> tuple[Array, Array]:
        """Return the rows of the session's frames that are new, and their tail bytes."""
        first, end = max(self._next, frames.first), frames.first + len(frames)
        row = np.array(view.numbers_between(first, end, self._bus, self._bits), np.int64) - frames.first
        row = row[(frames.flags[row] & (EXTENDED | REMOTE | ERROR) == EXTENDED) & (frames.length[row] > 0)]
        return row, frames.tail[row]
