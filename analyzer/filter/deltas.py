"""`frame.time_delta`: the time since the row before, in the order of a list."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.filter.history import LastBatches
from analyzer.tables import VERDICTS
from dissectors.kit.cells import numbers
from dissectors.times import NO_TIME

if TYPE_CHECKING:
    from analyzer.filter.history import SeenBatch
    from dissectors.kit import Array

_USED = VERDICTS.index("used")


class RowDeltas:
    """Times between rows, of a list of transfers and frames without one, or (`frame_list`) of all frames."""

    def __init__(self, *, frame_list: bool) -> None:
        self._frame_list = frame_list
        self._last = NO_TIME
        self._of: object = None
        self._parts: tuple[tuple[Array, Array], ...] = ()
        self._loose = np.zeros(0, np.int64)
        self._frames: LastBatches[tuple[Array, Array]] = LastBatches()  # of a list of frames: theirs

    def feed(self, context: SeenBatch) -> None:
        """Take the next batch."""
        if self._of is context:
            return
        self._of = context
        batch, none = context.batch, np.zeros(0, np.int64)
        if self._frame_list:
            starts, times = none, none
            self._loose = np.arange(len(batch.frames))
        else:
            starts = context.first_places
            times = numbers(batch.transfers.column("t")) if len(starts) else none
            verdicts = numbers(batch.frames.column("verdict")) if len(batch.frames) else none
            self._loose = np.flatnonzero(verdicts != _USED)
        frames = numbers(batch.frames.column("t"))[self._loose] if len(self._loose) else none
        errors = context.error_rows
        late = numbers(batch.events.column("t"))[errors] if len(errors) else none
        lines = numbers(batch.frames.column("line")) if len(batch.frames) else none
        before = np.searchsorted(lines, numbers(batch.events.column("line"))[errors]) if len(errors) else none
        place = np.concatenate((starts, self._loose + batch.first_frame, before + batch.first_frame))
        rank = np.concatenate((np.ones(len(starts) + len(self._loose), np.int64), np.zeros(len(errors), np.int64)))
        t = np.concatenate((times, frames, late)).astype(np.int64)
        order = np.lexsort((rank, place))
        ordered = np.concatenate(([self._last], t[order]))
        known = (ordered[1:] != NO_TIME) & (ordered[:-1] != NO_TIME)
        since = np.zeros(len(t), np.int64)
        since[order] = np.where(known, ordered[1:] - ordered[:-1], 0)
        has = np.ones(len(t), bool)
        has[order] = ordered[1:] != NO_TIME
        self._last = int(ordered[-1])
        cuts = np.cumsum((len(starts), len(self._loose)))
        self._parts = tuple(zip(np.split(since, cuts), np.split(has, cuts), strict=True))
        if self._frame_list and len(batch.frames):
            self._frames.add(batch.first_frame, len(batch.frames), self._parts[1])

    def of_transfers(self, context: SeenBatch) -> tuple[Array, Array]:
        """Return the times since the rows before transfers, and which have one."""
        self.feed(context)
        return self.of_frames(context, context.first_places) if self._frame_list else self._parts[0]

    def of_frames(self, context: SeenBatch, places: Array) -> tuple[Array, Array]:
        """Return those of frames, by their numbers from 0; of earlier batches only a list of frames has some."""
        self.feed(context)
        if self._frame_list:
            return self._of_last(places)
        since, has = self._parts[1]
        mine = self._loose + context.batch.first_frame
        at = np.searchsorted(mine, places)
        inside = at < len(mine)
        at = np.minimum(at, max(len(mine) - 1, 0))
        if not len(mine):
            return np.zeros(len(places), np.int64), np.zeros(len(places), bool)
        return since[at], has[at] & inside & (mine[at] == places)

    def _of_last(self, places: Array) -> tuple[Array, Array]:
        found, there = np.zeros(len(places), np.int64), np.zeros(len(places), bool)
        for first, (since, has) in self._frames.pairs:
            inside = np.flatnonzero((places >= first) & (places < first + len(since)))
            at = places[inside] - first
            found[inside], there[inside] = since[at], has[at]
        return found, there

    def of_errors(self, context: SeenBatch) -> tuple[Array, Array]:
        """Return those of error frames."""
        self.feed(context)
        return self._parts[2]
