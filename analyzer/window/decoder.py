"""A window of a capture decoded as a capture of its own, with the numbers that its frames have in the whole."""

from __future__ import annotations

from bisect import bisect_right
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from analyzer.decode.places import Places
from analyzer.window.cut import frame_tables
from dissectors.kit.cells import numbers
from dissectors.records import replace

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from analyzer._native import FrameBatch
    from analyzer.decode.engine import Batch, Engine
    from analyzer.window.cut import FrameSelection, FrameTables
    from dissectors.kit import Array


class WindowDecoder:
    """An engine that is fed with the inside of a window; `rows` counts the frames and events that were in it.

    Frames of a window of time follow each other, but where a clock was set back: there a new batch begins. With
    `alone` they are numbered as in a capture that holds nothing else, and no batch ends before it is full; its `places`
    are those of the whole.
    """

    def __init__(self, engine: Engine, selection: FrameSelection, *, alone: bool = False) -> None:
        self.rows = 0
        self._places = Places() if alone else None
        self._frames = 0
        self._engine = engine
        self._selection = selection
        self._inner: list[int] = []  # where a run of frames begins, as the engine counts
        self._shifts: list[int] = []  # by how much they are later in the whole capture

    def batches(self, recorded: Iterable[FrameBatch]) -> Iterator[Batch]:
        """Yield every batch, the last one when the recorded ones end."""
        for part, (frames, events), _ in self._selection.apply(frame_tables(recorded)):
            runs = _runs(part, frames, events) if self._places is None else [(frames, events)]
            if self._places is not None:
                self._places.add(part.first_frame, frames)
            for own, beside in runs:
                if not len(own) and not len(beside):
                    continue
                if len(own) and self._places is None:
                    if self._begins(part.first_frame + int(own[0])) and self._frames:
                        for batch in self._engine.flushed():
                            yield self._numbered(batch)
                    self._note(part.first_frame + int(own[0]))
                self._frames += len(own)
                self.rows += len(own) + len(beside)
                for batch in self._engine.feed(part.batch.pick(own.tobytes(), beside.tobytes())):
                    yield self._numbered(batch)
        for batch in self._engine.end():
            yield self._numbered(batch)

    def _begins(self, first: int) -> bool:
        """Return whether a frame does not follow the one before it."""
        return not self._shifts or first - self._frames != self._shifts[-1]

    def _note(self, first: int) -> None:
        if self._begins(first):
            self._inner.append(self._frames)
            self._shifts.append(first - self._frames)

    def _numbered(self, batch: Batch) -> Batch:
        if self._places is not None:
            return replace(batch, places=self._places, zero=self._selection.first)
        if not self._inner:
            return replace(batch, zero=self._selection.first)
        inner, shifts = np.array(self._inner, np.int64), np.array(self._shifts, np.int64)

        def outer(values: Array) -> Array:
            at = np.maximum(np.searchsorted(inner, values.astype(np.int64), "right") - 1, 0)
            return (values.astype(np.int64) + shifts[at]).astype(np.uint64)

        column = batch.transfers.column("frame")
        shifted = pa.ListArray.from_arrays(column.offsets, pa.array(outer(numbers(column.values))))
        settled = pa.array(outer(numbers(batch.settled.column("frame"))))
        return replace(
            batch,
            zero=self._selection.first,
            first_frame=batch.first_frame + self._shifts[max(bisect_right(self._inner, batch.first_frame) - 1, 0)],
            transfers=_with(batch.transfers, "frame", shifted),
            settled=_with(batch.settled, "frame", settled),
        )


def _with(table: pa.RecordBatch, name: str, column: pa.Array) -> pa.RecordBatch:
    at = table.schema.get_field_index(name)
    columns = [*table.columns[:at], column.cast(table.schema.field(at).type), *table.columns[at + 1 :]]
    return pa.RecordBatch.from_arrays(columns, schema=table.schema)


def _runs(part: FrameTables, frames: Array, events: Array) -> Iterator[tuple[Array, Array]]:
    """Yield rows of frames that follow each other, with the events among and behind them."""
    breaks = np.flatnonzero(np.diff(frames.astype(np.int64)) != 1) + 1
    if not len(breaks):
        if len(frames) or len(events):
            yield frames, events
        return
    lines, event_lines = numbers(part.frames.column("line")), numbers(part.events.column("line"))
    borders = np.searchsorted(event_lines[events], lines[frames[breaks]])
    yield from zip(np.split(frames, breaks), np.split(events, borders), strict=True)
