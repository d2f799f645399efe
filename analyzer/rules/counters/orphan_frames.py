"""Transfers of which later frames came, but not the start: by their IDs they are missing, and yet they were sent."""

from __future__ import annotations

from bisect import bisect_left
from typing import TYPE_CHECKING

import numpy as np

from analyzer.rules.frames.foreign import session_bits
from analyzer.tables import TAIL_ID, VERDICTS
from dissectors.kit import NO_TIME, by_key
from dissectors.records import dataclass, field

if TYPE_CHECKING:
    from collections.abc import Iterable

    from dissectors.kit import Array, View

_ASTRAY = tuple(VERDICTS.index(name) for name in ("orphan", "wrong transfer id"))
_MOST_SESSIONS = 1 << 12
_MOST_FRAMES = 256  # of a session, the latest: of two seconds and more
_NEVER = 1 << 62


@dataclass(slots=True, eq=False)
class _Frames:
    """Frames of a session: numbers, times and transfer IDs; `ordered` unless they came late or a clock was set back."""

    number: list[int] = field(default_factory=list)
    t: list[int] = field(default_factory=list)
    transfer_id: list[int] = field(default_factory=list)
    ordered: bool = True

    def extend(self, number: list[int], t: list[int], transfer_id: list[int], *, ordered: bool) -> None:
        """Add some, which are `ordered` among themselves or not."""
        if self.number:
            ordered &= number[0] >= self.number[-1] and t[0] >= self.t[-1]
        self.ordered &= ordered
        for column, values in ((self.number, number), (self.t, t), (self.transfer_id, transfer_id)):
            column.extend(values[-_MOST_FRAMES:])
            if len(column) > 2 * _MOST_FRAMES:
                del column[:-_MOST_FRAMES]

    def ids(self, since: int, low: int, high: int) -> list[int]:
        """Return the transfer IDs of those that came after a time, with numbers from `low` to before `high`."""
        first = max(len(self.number) - _MOST_FRAMES, 0)
        if self.ordered:
            begin = max(bisect_left(self.t, since, first), bisect_left(self.number, low, first))
            return self.transfer_id[begin : bisect_left(self.number, high, first)]
        every = zip(self.number[first:], self.t[first:], self.transfer_id[first:], strict=True)
        return [transfer_id for number, t, transfer_id in every if t >= since and low <= number < high]

    def any(self, since: int, low: int, high: int) -> bool:
        """Return whether there are such frames."""
        first = max(len(self.number) - _MOST_FRAMES, 0)
        if self.ordered:
            begin = max(bisect_left(self.t, since, first), bisect_left(self.number, low, first))
            return begin < len(self.number) and self.number[begin] < high
        every = zip(self.number[first:], self.t[first:], strict=True)
        return any(t >= since and low <= number < high for number, t in every)


class OrphanFrames:
    """Remembers the frames of sessions that belong to no transfer."""

    def __init__(self) -> None:
        self._frames: dict[int, _Frames] = {}
        self._newest: dict[int, int] = {}  # the latest time of each session

    def feed(self, view: View) -> None:
        """Add those of a batch, and of earlier ones whose sessions became certain."""
        late = view.settled.of(np.flatnonzero(np.isin(view.settled.verdict, _ASTRAY) & view.settled.known))
        self._note_all(late.bus, session_bits(late.id, late.verdict), late.number, late.t, late.tail)
        f = view.frames
        if not f.verdict.any():
            return
        rows = np.flatnonzero(np.isin(f.verdict, _ASTRAY))
        bits = session_bits(f.id[rows], f.verdict[rows])
        self._note_all(f.bus[rows].astype(np.int64), bits, f.first + rows, f.t[rows], f.tail[rows])

    def possible(self, sessions: Array, since: Array, mask: Array) -> Array:
        """Return of rows of a mask those in whose session any came after a time."""
        if not self._newest:
            return np.empty(0, np.int64)
        rows = np.flatnonzero(mask & (since != NO_TIME))
        each, which = np.unique(sessions[rows], return_inverse=True)
        newest = np.array([self._newest.get(session, NO_TIME) for session in each.tolist()], np.int64)
        came: Array = (newest[which] != NO_TIME) & (newest[which] >= since[rows])
        return np.extract(came, rows)

    def hold(self, session: int, since: int, lead: int, missing: Iterable[int]) -> bool:
        """Return whether of all missing transfer IDs frames came after a time and before a frame.

        `session` is the bus above 32 bits of `session_bits`.
        """
        frames = self._frames.get(session)
        if frames is None or since == NO_TIME or self._newest[session] < since:
            return False
        return set(frames.ids(since, 0, lead)).issuperset(missing)

    def came(self, session: int, since: int, lead: int, *, behind: bool = False) -> bool:
        """Return whether any came after a time, and before a frame or `behind` it."""
        if since == NO_TIME or self._newest.get(session, NO_TIME) < since:
            return False
        return self._frames[session].any(since, *((lead + 1, _NEVER) if behind else (0, lead + 1)))

    def _note_all(self, bus: Array, bits: Array, number: Array, t: Array, tail: Array) -> None:
        """Note frames: numbers, times and tail bytes of sessions of a bus."""
        if not len(bus):
            return
        sessions = bus << 32 | bits
        order, begins = by_key(sessions)
        number, t, ids = (column[order] for column in (number, t, tail & TAIL_ID))
        back = np.zeros(len(order), bool)
        back[1:] = (number[1:] < number[:-1]) | (t[1:] < t[:-1])
        back[begins] = False
        back, last = np.logical_or.reduceat(back, begins), np.maximum.reduceat(t, begins)
        each = sessions[order[begins]], begins, np.append(begins[1:], len(order)), back, last
        in_turn = np.argsort(order[begins], kind="stable")
        columns = number.tolist(), t.tolist(), ids.tolist()
        for session, begin, end, late, newest in zip(*(part[in_turn].tolist() for part in each), strict=True):
            if session not in self._frames:
                if len(self._frames) >= _MOST_SESSIONS:
                    continue
                self._frames[session] = _Frames()
            self._frames[session].extend(*(column[begin:end] for column in columns), ordered=not late)
            self._newest[session] = max(self._newest.get(session, newest), newest)
