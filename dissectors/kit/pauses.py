"""When a whole bus was silent."""

from __future__ import annotations

from bisect import bisect_left
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dissectors.kit.clock import times_by_bus

if TYPE_CHECKING:
    from collections.abc import Iterable

    from dissectors.kit.array import Array
    from dissectors.kit.view import View


_MOST = 1024  # of a bus, the latest
_FEW = 16


class _Silences(NamedTuple):
    """When the silences of a bus began, and when they ended; whether no clock was set back between them.

    The lists are the two `columns`: among few numbers they are faster.
    """

    columns: Array
    begins: list[int]
    ends: list[int]
    in_order: bool


class Pauses:
    """Times in which a whole bus was silent, and when it was heard last.

    Args:
        least: shorter ones, in nanoseconds, do not count.
    """

    def __init__(self, least: int) -> None:
        self._least = least
        self.last: dict[int, int] = {}
        self._known: dict[int, list[tuple[int, int]]] = {}
        self._columns: dict[int, _Silences] = {}  # the same, once somebody asks

    def feed(self, view: View) -> None:
        """Add the next batch."""
        for one in times_by_bus(view.frames):
            bus, t = one.bus, one.t
            last = self.last.get(bus, int(t[0]))
            if int(t[0]) - last > self._least:
                self._add(bus, [(last, int(t[0]))])
            if one.longest > self._least:
                at = np.flatnonzero(t[1:] - t[:-1] > self._least)[-_MOST:]
                self._add(bus, zip(t[at].tolist(), t[at + 1].tolist(), strict=True))
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
        columns, begins, ends, in_order = self._both(bus)
        low, high = (bisect_left(ends, start), bisect_left(begins, stop)) if in_order else (0, len(begins))
        if high - low <= _FEW:
            few = (min(ends[k], stop) - max(begins[k], start) - spare for k in range(low, high))
            return float(sum(part for part in few if part > 0))
        parts = np.minimum(columns[1, low:high], stop) - np.maximum(columns[0, low:high], start) - spare
        return float(parts[parts > 0].sum())

    def _both(self, bus: int) -> _Silences:
        if bus not in self._columns:
            columns = np.array(self._known.get(bus, ()), np.int64).reshape(-1, 2).T.copy()
            in_order = bool((np.diff(columns) >= 0).all())
            begins, ends = columns.tolist()
            self._columns[bus] = _Silences(columns, begins, ends, in_order)
        return self._columns[bus]

    def _add(self, bus: int, silences: Iterable[tuple[int, int]]) -> None:
        known = self._known.setdefault(bus, [])
        known.extend(silences)
        del known[:-_MOST]
        self._columns.pop(bus, None)
