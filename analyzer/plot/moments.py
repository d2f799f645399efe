"""Moments of rows: their times and frames, and the timelines that a viewer offers for them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from analyzer.facts.summary import YEAR_2000
from analyzer.report.moments import clock
from dissectors.kit import NO_TIME, SECOND
from dissectors.kit.cells import numbers, valid
from dissectors.records import dataclass

if TYPE_CHECKING:
    from dissectors.kit import Array

TIME, SINCE_START, FRAME = "time", "since_start", "frame"
NO_FRAME = 0


@dataclass(frozen=True, slots=True)
class Moments:
    """A row each: `t` in ns, `NO_TIME` where there is none, and `frame` numbers from 1, `NO_FRAME` likewise."""

    t: Array
    frame: Array

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.t)

    def __getitem__(self, rows: slice | Array) -> Moments:
        """Return some of the rows."""
        return Moments(self.t[rows], self.frame[rows])


@dataclass(frozen=True, slots=True)
class PlotClock:
    """The timelines of a capture. `start` is the time of its first frame that has one, None without times."""

    start: int | None = None

    @property
    def absolute(self) -> bool:
        """True if times are dates."""
        return self.start is not None and self.start >= YEAR_2000

    def timelines(self, moments: Moments) -> list[tuple[str, pa.Array]]:
        """Make columns by timeline, for rows of which all or none have a time, and likewise a frame."""
        found: list[tuple[str, pa.Array]] = []
        if self.start is not None and len(moments) and moments.t[0] != NO_TIME:
            t = np.ascontiguousarray(moments.t, np.int64)
            if self.absolute:
                found.append((TIME, pa.array(t.view("datetime64[ns]"))))
            found.append((SINCE_START, pa.array((t - self.start).view("timedelta64[ns]"))))
        if len(moments) and moments.frame[0] != NO_FRAME:
            found.append((FRAME, pa.array(moments.frame.astype(np.int64, copy=False))))
        return found

    def written(self, t: int) -> str:
        """Write a time of day, or seconds since the start where times are no dates: columns of a viewer are narrow."""
        if t == NO_TIME or self.start is None:
            return ""
        return clock(t) if self.absolute else f"+{(t - self.start) / SECOND:.3f} s"

    def parts(self, moments: Moments) -> list[slice | Array]:
        """Return rows that have the same timelines; all in one piece if they can be."""
        if self.start is None:
            return [slice(None)]
        timed = moments.t != NO_TIME
        if timed.all():
            return [slice(None)]
        return [np.flatnonzero(timed), np.flatnonzero(~timed)]


def times(column: pa.Array) -> Array:
    """Return a time column in ns, `NO_TIME` where it is null."""
    t: Array = numbers(column)
    return t if not column.null_count else np.where(valid(column), t, NO_TIME)
