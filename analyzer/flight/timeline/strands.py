"""Strands: courses on an axis, thinned to what a drawing can show."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.flight.timeline.axis import TimelineAxis
    from analyzer.flight.timeline.course import DeviceValues
    from dissectors.kit import Array

POINTS = 500  # across a drawing
_LATE = 4  # usual distances between values, beyond which none came


@dataclass(frozen=True, slots=True)
class StrandSpan:
    """The drawn span of an axis: from `start` to `end`."""

    axis: TimelineAxis
    start: int
    end: int


@dataclass(frozen=True, slots=True)
class Strand:
    """Values over a time line: the lowest and the highest (f64) at times on its axis (i64, ns); a new part `begins`."""

    t: Array
    low: Array
    high: Array
    begins: Array

    @property
    def spans(self) -> list[tuple[int, int]]:
        """The times in which values came."""
        borders = [*np.flatnonzero(self.begins).tolist(), len(self.t)]
        return [(int(self.t[low]), int(self.t[high - 1])) for low, high in pairwise(borders)]


def strand(courses: Sequence[tuple[DeviceValues, Sequence[int]]], span: StrandSpan) -> Strand | None:
    """Return some rows of some courses as one band; None where no value came."""
    axis = span.axis
    low_ran, high_ran = axis.ran(span.start), axis.ran(span.end)
    parts = []
    for course, rows in courses:
        cut = course.cut(low_ran, high_ran + 1)
        low, high = (find.reduce(kept[list(rows)], axis=0) for find, kept in ((np.fmin, cut.low), (np.fmax, cut.high)))
        t = axis.of(cut.start) + min(cut.step, span.end - span.start) // 2
        good = np.isfinite(low) & np.isfinite(high) & (t >= span.start - cut.step) & (t <= span.end + cut.step)
        parts.append((np.clip(t[good], span.start, span.end), low[good].astype(float), high[good].astype(float)))
    t, low, high = (np.concatenate(one) for one in zip(*parts, strict=True)) if parts else (np.zeros(0),) * 3
    if not len(t):
        return None
    order = np.argsort(t, kind="stable")
    t, low, high = t[order], low[order], high[order]
    column = (t - span.start) * POINTS // max(span.end - span.start, 1)
    first = np.flatnonzero(np.diff(column, prepend=-1))
    t, low, high = t[first], np.minimum.reduceat(low, first), np.maximum.reduceat(high, first)
    apart = np.diff(t)
    begins = np.ones(len(t), bool)
    begins[1:] = apart > _LATE * np.median(apart) if len(apart) else False
    return Strand(t, low, high, begins)
