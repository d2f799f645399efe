"""When rows happened: their times and frames, and the timelines that a viewer offers for them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from analyzer.facts.summary import YEAR_2000
from analyzer.tables import numbers, valid
from dissectors.conformance import NO_TIME

if TYPE_CHECKING:
    from dissectors.conformance import Words

TIME, SINCE_START, FRAME = "time", "since_start", "frame"
NO_FRAME = 0


@dataclass(frozen=True, slots=True)
class Moments:
    """A row each: `t` in ns, `NO_TIME` where there is none, and `frame` numbers from 1, `NO_FRAME` likewise."""

    t: Words
    frame: Words

    def __len__(self) -> int:
        """Rows."""
        return len(self.t)

    def __getitem__(self, rows: slice | Words) -> Moments:
        """Some of the rows."""
        return Moments(self.t[rows], self.frame[rows])


@dataclass(frozen=True, slots=True)
class Clock:
    """The timelines of a capture. `start` is the time of its first frame that has one, None without times."""

    start: int | None = None

    @property
    def absolute(self) -> bool:
        """Whether times are dates."""
        return self.start is not None and self.start >= YEAR_2000

    def timelines(self, moments: Moments) -> list[tuple[str, pa.Array]]:
        """Columns by timeline, for rows of which all or none have a time, and likewise a frame."""
        found: list[tuple[str, pa.Array]] = []
        if self.start is not None and len(moments) and moments.t[0] != NO_TIME:
            t = np.ascontiguousarray(moments.t, np.int64)
            if self.absolute:
                found.append((TIME, pa.array(t.view("datetime64[ns]"))))
            found.append((SINCE_START, pa.array((t - self.start).view("timedelta64[ns]"))))
        if len(moments) and moments.frame[0] != NO_FRAME:
            found.append((FRAME, pa.array(moments.frame.astype(np.int64, copy=False))))
        return found

    def parts(self, moments: Moments) -> list[slice | Words]:
        """Rows that have the same timelines; all in one piece if they can be."""
        if self.start is None:
            return [slice(None)]
        timed = moments.t != NO_TIME
        if timed.all():
            return [slice(None)]
        return [np.flatnonzero(timed), np.flatnonzero(~timed)]


def times(column: pa.Array) -> Words:
    """A time column in ns, `NO_TIME` where it is null."""
    t: Words = numbers(column)
    return t if not column.null_count else np.where(valid(column), t, NO_TIME)
