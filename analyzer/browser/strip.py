"""The strip over the whole capture: load, flights, findings and marks by time, and where the list stands."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from analyzer.browser.store.store import TableStore
    from dissectors.kit import Array

_BARS = " ▁▂▃▄▅▆▇█"
_PLAIN_BARS = " .:-=+*#@"  # where the terminal has no blocks
_STEP = 1024  # frames between two ticks of a segment


class StripCell(NamedTuple):
    """A column of the strip: its sign, and the style that it is drawn in."""

    sign: str
    style: str


class Strip:
    """Computes the cells for a width; ticks of the store are taken as they come."""

    def __init__(self, store: TableStore, *, plain: bool = False) -> None:
        self._store = store
        self._bars = _PLAIN_BARS if plain else _BARS
        self._known = 0  # segments
        self._all = self._places = np.zeros(0, np.int64)  # times, and what frame each is the time of

    def _times(self) -> Array:
        new = self._store.segments[self._known :]
        if new:
            self._known += len(new)
            places = [one.first_frame + np.arange(len(one.ticks)) * _STEP for one in new]
            self._places = np.concatenate([self._places, *places])
            self._all = np.maximum.accumulate(np.concatenate([self._all, *(one.ticks for one in new)]))
        return self._all

    def place_of(self, t: int | None, width: int) -> int | None:
        """Return the column of a time."""
        low, high = self._store.low, self._store.high
        if t is None or low is None or high is None or width <= 0:
            return None
        return max(0, min(width - 1, (t - low) * width // max(1, high - low + 1)))

    def time_of(self, column: int, width: int) -> int | None:
        """Return the time at the start of a column."""
        low, high = self._store.low, self._store.high
        if low is None or high is None:
            return None
        return low + (high - low + 1) * column // max(1, width)

    def loads(self, width: int) -> Array:
        """Return how many frames each column has, from 0 to 1 of the most."""
        times, low, high = self._times(), self._store.low, self._store.high
        if not len(times) or low is None or high is None or width <= 0:
            return np.zeros(max(width, 0))
        edges = low + (high - low + 1) * np.arange(width + 1, dtype=np.float64) / width
        counts = np.diff(np.interp(edges, times.astype(np.float64), self._places))
        most = counts.max()
        return counts / most if most > 0 else counts

    def cells(
        self, width: int, *, now: int | None, flights: Sequence[tuple[int, int]], findings: Iterable[tuple[int, str]],
        marks: Iterable[int],
    ) -> list[StripCell]:  # fmt: skip
        """Return the columns; findings are times with a severity, flights spans of time.

        `!` an error, `?` a warning, `o` a mark, a digit the begin of a flight: they stand in place of the load, and so
        does the place of the list.
        """
        loads = self.loads(width)
        steps = np.ceil(loads * (len(self._bars) - 1)).astype(int)
        flying = np.zeros(width, bool)
        for start, end in flights:
            first, last = self.place_of(start, width), self.place_of(end, width)
            if first is not None and last is not None:
                flying[first : last + 1] = True
        cells = [StripCell(self._bars[step], "head" if flying[k] else "dim") for k, step in enumerate(steps.tolist())]
        for number, (start, _) in enumerate(flights, 1):
            first = self.place_of(start, width)
            if first is not None:
                cells[first] = StripCell(str(number % 10), "head")
        for t, severity in sorted(findings, key=lambda one: one[1] == "error"):
            at = self.place_of(t, width)
            if at is not None and severity in ("error", "warning"):
                cells[at] = StripCell("!" if severity == "error" else "?", "bad" if severity == "error" else "warn")
        for t in marks:
            at = self.place_of(t, width)
            if at is not None:
                cells[at] = StripCell("o", "good")
        at = self.place_of(now, width)
        if at is not None:
            cells[at] = StripCell(cells[at].sign if cells[at].sign != " " else "|", "focus")
        return cells
