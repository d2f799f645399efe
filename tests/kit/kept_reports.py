"""The last reports of many senders, and new ones: what periods are told from."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from dissectors.kit import Array

MEMORY = 15  # periods that say what is usual
KEPT = MEMORY + 1  # reports, between which they are
_ROOM = 2 * KEPT  # for those that are kept, and as many new ones: a power of two


class NewReports:
    """New reports of some senders, one sender after the other: at least one of each, the first one at its `start`.

    Args:
        senders: each stands there once.
        size: how many reports of each there are.
        t: when they came.
        lost: how many were lost up to each.
    """

    def __init__(self, senders: Array, size: Array, t: Array, lost: Array) -> None:
        self.senders, self.size, self.t, self.lost = senders, size, t, lost
        self.stop = np.cumsum(size)
        self.start = self.stop - size
        self.of = np.repeat(np.arange(len(senders)), size)

    def split(self, some: Array) -> tuple[NewReports, NewReports]:
        """Return the reports of some senders, by their places, and those of the others."""
        asked = np.zeros(len(self.senders), bool)
        asked[some] = True
        which = asked[self.of]
        parts = ((asked, which), (~asked, ~which))
        one, other = (NewReports(self.senders[a], self.size[a], self.t[b], self.lost[b]) for a, b in parts)
        return one, other


class KeptReports:
    """The last reports of each sender, a row each, at most `KEPT` of its `count`; `last` is the time of the last one.

    Behind the end of a row it goes on at its begin.
    """

    def __init__(self) -> None:
        self.count = np.empty(0, np.int64)
        self.last = np.empty(0, np.int64)
        self._next = np.empty(0, np.int64)  # where the next report goes
        self._t = np.empty((0, _ROOM), np.int64)
        self._lost = np.empty((0, _ROOM), np.int64)

    def make_room(self, more: int) -> None:
        """Add so many senders, without reports."""
        none, room = np.zeros(more, np.int64), np.zeros((more, _ROOM), np.int64)
        self.count, self.last, self._next = (np.append(known, none) for known in (self.count, self.last, self._next))
        self._t, self._lost = (np.append(known, room, axis=0) for known in (self._t, self._lost))

    def take(self, senders: Array) -> tuple[Array, Array]:
        """Return times and losses of the last reports of some senders, a row each; they end where a row ends."""
        return self._at((self._next[senders, None] + np.arange(-KEPT, 0)), senders[:, None])

    def put(self, senders: Array, count: Array, t: Array, lost: Array) -> None:
        """Keep these instead, in rows as `take` gives them, of which so many count."""
        self._t[senders, KEPT:], self._lost[senders, KEPT:], self._next[senders] = t, lost, 0
        self.count[senders], self.last[senders] = count, t[:, -1]

    def write(self, new: NewReports, *, many: bool) -> None:
        """Write down reports, of senders with more than `KEPT` or of the others, before they are kept.

        What is kept is still there beside those of the others.
        """
        left = new.stop[new.of] - np.arange(len(new.t))
        rows = np.flatnonzero((left <= KEPT) & ((new.size > KEPT) == many)[new.of])
        of = new.of[rows]
        at = new.senders[of], (self._next[new.senders[of]] + new.size[of] - left[rows]) & _ROOM - 1
        self._t[at], self._lost[at] = new.t[rows], new.lost[rows]

    def add(self, new: NewReports) -> None:
        """Keep reports; those of senders with at most `KEPT` are written down."""
        if int(new.size.max()) > KEPT:
            self.write(new, many=True)
        self._next[new.senders] = (self._next[new.senders] + new.size) & _ROOM - 1
        self.count[new.senders] = np.minimum(self.count[new.senders] + new.size, KEPT)
        self.last[new.senders] = new.t[new.stop - 1]

    def took(self, new: NewReports) -> Array:
        """Return the time in front of each new report, 0 before the first one of a sender."""
        took = np.empty_like(new.t)
        np.subtract(new.t[1:], new.t[:-1], out=took[1:])
        took[new.start] = np.where(self.count[new.senders] > 0, new.t[new.start] - self.last[new.senders], 0)
        return took

    def before(self, senders: Array, place: Array, count: Array) -> tuple[Array, Array]:
        """Return times and losses of the last `KEPT` before new reports that are written down, a column each.

        They have senders, and places among theirs; where there are fewer than that before it, which are counted, the
        first one is repeated.
        """
        return self._at(np.maximum(np.arange(-KEPT, 0)[:, None], -count) + (self._next[senders] + place), senders)

    def _at(self, places: Array, senders: Array) -> tuple[Array, Array]:
        """Return times and losses at places in the rows of senders; flat ones are found faster."""
        places &= _ROOM - 1
        places += senders * _ROOM
        return self._t.ravel().take(places), self._lost.ravel().take(places)
