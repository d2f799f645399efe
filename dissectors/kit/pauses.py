"""When a whole bus was silent."""

from __future__ import annotations

from bisect import bisect_left
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit.clock import times_by_bus

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit.array import Array
    from dissectors.kit.view import View


_MOST = 1024  # of a bus, the latest
_FEW = 16
_LATEST = 64
_AT_ONCE = 1 << 16  # of questions and silences that are compared together


class _Silences:
    """When the silences of a bus began, and when they ended: two rows of `columns`."""

    def __init__(self, columns: Array) -> None:
        self.columns = columns

    @cached_property
    def begins(self) -> list[int]:
        """When they began: among few numbers lists are faster."""
        return list(self.columns[0].tolist())

    @cached_property
    def ends(self) -> list[int]:
        """When they ended."""
        return list(self.columns[1].tolist())

    @cached_property
    def in_order(self) -> bool:
        """True if no clock was set back between them."""
        return bool((self.columns[:, 1:] >= self.columns[:, :-1]).all())

    @cached_property
    def rooms(self) -> tuple[Array, Array]:
        """Room for what is worked out of both columns, and of how long silences last."""
        return np.empty_like(self.columns), np.empty(len(self.columns[0]))

    def between(self, start: int, stop: int) -> tuple[int, int]:
        """Return the first silence that may reach into some time, and the one behind the last."""
        if self.in_order:
            return bisect_left(self.ends, start), bisect_left(self.begins, stop)
        return 0, len(self.begins)

    def parts(self, some: range, start: int, stop: int, spare: float) -> Iterator[float]:
        """Yield how long some silences last between two times, without the first `spare` ns."""
        begins, ends = self.begins, self.ends
        for k in some:
            until, since = ends[k], begins[k]
            part = min(until, stop) - max(since, start) - spare
            if part > 0:
                yield part

    def sum(self, some: slice, start: int, stop: int, spare: float) -> float:
        """Return how long they last together."""
        rooms, sizes = self.rooms
        until, since = (room[some] for room in rooms)
        np.minimum(self.columns[1, some], stop, out=until)
        np.maximum(self.columns[0, some], start, out=since)
        parts = np.subtract(until, since, out=sizes[some])
        parts -= spare
        return float(np.maximum(parts, 0.0, out=parts).sum())


_NONE = _Silences(np.empty((2, 0), np.int64))


class Pauses:
    """Times in which a whole bus was silent, and when it was heard last.

    Args:
        least: shorter ones, in nanoseconds, do not count.
    """

    def __init__(self, least: int) -> None:
        self._least = least
        self.last: dict[int, int] = {}
        self._known: dict[int, _Silences] = {}

    def feed(self, view: View) -> None:
        """Add the next batch."""
        for one in times_by_bus(view.frames):
            bus, t = one.bus, one.t
            last = self.last.get(bus, int(t[0]))
            if int(t[0]) - last > self._least:
                self._add(bus, np.array([[last], [t[0]]]))
            if one.longest > self._least:
                at = np.flatnonzero(t[1:] - t[:-1] > self._least)[-_MOST:]
                self._add(bus, np.stack((t[at], t[at + 1])))
            self.last[bus] = int(t[-1])

    def first(self, bus: int, start: int, stop: int) -> int:
        """Return when the first silence between two times begins, else the second time."""
        begins, ends = self._both(bus).columns
        inside = (begins < stop) & (ends > start)
        return max(start, int(begins[inside].min())) if inside.any() else stop

    def inside(self, bus: int, start: int, stop: int, spare: float = 0) -> float:
        """Return nanoseconds of silence between two times, without the first `spare` ones of each.

        Where others are seldom heard, too, each time is proof that somebody with that period might have been.
        """
        known = self._both(bus)
        low, high = known.between(start, stop)
        if high - low <= _FEW:
            return float(sum(known.parts(range(low, high), start, stop, spare)))
        return known.sum(slice(low, high), start, stop, spare)

    def last_for(self, least: Array, bus: int, start: Array, stop: Array, spare: Array) -> Array:
        """Return whether silences between two times, each without the first `spare` ns, have at least so many ns.

        A row of all five is a question.
        """
        columns, had = self._both(bus).columns, np.zeros(len(least), np.int64)
        left = np.arange(len(least))
        for silences in (columns[:, -_LATEST:], columns[:, :-_LATEST]):  # mostly the latest ones are enough
            had[left] += _lasted(silences, start[left], stop[left], spare[left])
            left = (had < least).nonzero()[0]
        enough: Array = had >= least
        return enough

    def _both(self, bus: int) -> _Silences:
        return self._known.get(bus, _NONE)

    def _add(self, bus: int, silences: Array) -> None:
        known = np.concatenate((self._both(bus).columns, silences), axis=1)
        self._known[bus] = _Silences(known[:, -_MOST:].copy())


def _lasted(silences: Array, start: Array, stop: Array, spare: Array) -> Array:
    """Return how many ns of silences, each without the first `spare`, are between two times: a row is a question."""
    begins, ends = silences
    found = np.zeros(len(start), np.int64)
    if not len(start):
        return found
    if spare.min() >= 0:  # then only what reaches into some of the times counts
        near = (begins < stop.max()) & (ends > start.min())
        begins, ends = begins[near], ends[near]
    if not len(begins):
        return found
    size = max(_AT_ONCE // len(begins), 1)
    for at in range(0, len(start), size):
        some = slice(at, at + size)
        parts = np.minimum(ends, stop[some, None])
        parts -= np.maximum(begins, start[some, None])
        parts -= spare[some, None]
        found[some] = np.maximum(parts, 0, out=parts).sum(axis=1)
    return found
