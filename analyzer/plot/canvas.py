"""The way of points: new series get their name and colour, then the points become chunks, or wait to be thinned."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.plot import chunks, colours
from analyzer.plot.inventory import Inventory
from analyzer.plot.moments import Moments, PlotClock
from analyzer.plot.thinning import Thinned, Thinning

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from rerun.chunk import Chunk

    from analyzer.plot.chunks import Style
    from analyzer.plot.inventory import Series
    from dissectors.kit import Array

    Column = tuple[Series, Array, Array | None]  # a series, its values, and which of them there are (None: all)

LEAST_POINTS = 4  # of a thinned series


class Canvas:
    """Takes what is to be shown and gives it to `send`.

    Args:
        send: takes chunks.
        most: points of a line at most; None keeps all.

    It is to `begin` before the first points that have times.
    """

    def __init__(self, send: Callable[[Sequence[Chunk]], None], most: int | None = None) -> None:
        self.inventory = Inventory()
        self.clock = PlotClock()
        self._send = send
        self._most = None if most is None else max(most, LEAST_POINTS)
        self._waiting: dict[str, Thinned] = {}
        self._thinned: dict[str, Thinning] = {}
        self._styles: list[Style] = []
        self._made: list[Chunk] = []

    def begin(self, clock: PlotClock) -> None:
        """Begin: from here on there are times."""
        self.clock = clock
        if clock.absolute and clock.start is not None:
            self._made.append(chunks.start(clock.start))

    def lines(self, columns: Iterable[Column], moments: Moments) -> None:
        """Draw points of lines that share their rows."""
        whole: list[tuple[str, Array]] = []
        for series, values, has in columns:
            count = len(values) if has is None else int(has.sum())
            valid = None if count == len(values) else has
            if not self._known(series, count):
                continue
            points, at = values.astype(np.float64, copy=False), moments
            if valid is not None:
                points, at = points[valid], moments[valid]
            if self._most is not None:
                self._thin(series.path, self._most).feed(at, points)
            elif valid is None:
                whole.append((series.path, points))
            else:
                self._made += chunks.scalars([(series.path, points)], at, self.clock)
        if whole:
            self._made += chunks.scalars(whole, moments, self.clock)

    def states(self, series: Series, values: Sequence[str], moments: Moments) -> None:
        """Draw changes of a state by name; `off` is what a flag is when it is not set."""
        if self._known(series, len(values)):
            self._made += chunks.states(series.path, values, moments, self.clock)

    def texts(self, series: Series, values: Sequence[str], levels: Sequence[str], moments: Moments) -> None:
        """Draw lines of a log."""
        if self._known(series, len(values)):
            self._made += chunks.texts(series.path, values, levels, moments, self.clock)

    def page(self, series: Series, markdown: str) -> None:
        """Draw a page of text."""
        if self._known(series, 1):
            self._made.append(chunks.document(series.path, markdown))

    def flush(self) -> None:
        """Give away what was made since the last time."""
        made = [*chunks.styled(self._styles), *self._made]
        self._styles, self._made = [], []
        if made:
            self._send(made)

    def finish(self) -> None:
        """Give what has waited to be thinned."""
        for path, one in self._waiting.items():
            moments, values = one.points()
            self._made += chunks.scalars([(path, values)], moments, self.clock)
            self.flush()
            if one.bucket > 1:
                self._thinned[path] = one.thinning
        self._waiting = {}

    def thinned(self) -> dict[str, Thinning]:
        """Return what became of the lines that lost any points, by path; after `finish`."""
        return self._thinned

    def _thin(self, path: str, most: int) -> Thinned:
        if path not in self._waiting:
            self._waiting[path] = Thinned(most)
        return self._waiting[path]

    def _known(self, series: Series, count: int) -> bool:
        """Return True if there is something to show, and room for it; a new series gets its style."""
        if not count:
            return False
        if self.inventory.add(series):
            self._styles += _style(series)
        series.count += count
        return series.path in self.inventory.series


def _style(series: Series) -> list[Style]:
    name = series.title if not series.role else f"{series.title} {series.role}"
    colour = colours.device(series.number)
    if series.kind == "line":
        if series.role == "limit":
            return [chunks.line_style(series.path, name, colours.LIMIT, 1.0)]
        quiet = series.role == "commanded"
        return [chunks.line_style(series.path, name, colours.lighter(colour) if quiet else colour, 1.0 + (not quiet))]
    if series.kind == "points":
        return [chunks.point_style(series.path, name, colours.BROKEN if series.active else colours.CALM)]
    if series.kind == "state" and series.flag:
        return [chunks.state_style(series.path, ["off", "on"], [colours.OFF, colours.ON])]
    if series.states:
        return [chunks.state_style(series.path, series.states, colours.states(series.states))]
    return []
