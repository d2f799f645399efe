"""When a whole bus was silent."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit.clock import times_by_bus

if TYPE_CHECKING:
    from dissectors.kit.array import Array
    from dissectors.kit.view import View


class Pauses:
    """Times in which a whole bus was silent, and when it was heard last.

    Args:
        least: shorter ones, in nanoseconds, do not count. The last 1024 of a bus are kept.
    """

    def __init__(self, least: int) -> None:
        self._least = least
        self.last: dict[int, int] = {}
        self._known: dict[int, list[tuple[int, int]]] = {}
        self._columns: dict[int, Array] = {}  # the same, once somebody asks

    def feed(self, view: View) -> None:
        """Add the next batch."""
        for one in times_by_bus(view.frames):
            bus, t = one.bus, one.t
            self._between(bus, self.last.get(bus, int(t[0])), int(t[0]))
            if one.longest > self._least:
                for at in np.flatnonzero(t[1:] - t[:-1] > self._least).tolist():
                    self._between(bus, int(t[at]), int(t[at + 1]))
            self.last[bus] = int(t[-1])

    def first(self, bus: int, start: int, stop: int) -> int:
        """Return when the first silence between two times begins, else the second time."""
        begins, ends = self._both(bus)
        inside = (begins < stop) & (ends > start)
        return max(start, int(begins[inside].min())) if inside.any() else stop

    def inside(self, bus: int, start: int, stop: int, spare: float = 0) -> float:
        """Return nanoseconds of silence between two times, without the first `spare` ones of each.

        Where others are seldom heard, too, each time is proof that somebody with that period might have been.
        """
        begins, ends = self._both(bus)
        parts = np.minimum(ends, stop) - np.maximum(begins, start) - spare
        return float(parts[parts > 0].sum())

    def _both(self, bus: int) -> Array:
        """Return when the silences of a bus began, and when they ended."""
        if bus not in self._columns:
            self._columns[bus] = np.array(self._known.get(bus, ()), np.int64).reshape(-1, 2).T
        return self._columns[bus]

    def _between(self, bus: int, start: int, stop: int) -> None:
        if stop - start > self._least:
            known = self._known.setdefault(bus, [])
            known.append((start, stop))
            del known[:-1024]
            self._columns.pop(bus, None)
