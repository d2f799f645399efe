"""A part of a capture that is not decoded: windows over frames and events, for all that copies them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from analyzer.tables import EVENT_ROWS, FRAMES, numbers, wrap
from analyzer.window import NEVER, Selection, Window, Windowed

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    import numpy.typing as npt

    from analyzer._native import Piece
    from analyzer.engine import Batch

    Rows = npt.NDArray[Any]

# A frame as its reader left it, before anybody judged it.
RECORDED = FRAMES.remove(FRAMES.get_field_index("anomaly")).remove(FRAMES.get_field_index("verdict"))


@dataclass(frozen=True, slots=True)
class Slice:
    """A piece with its tables; `first_frame` is the number of its first frame in the capture, from 0."""

    piece: Piece
    frames: pa.RecordBatch
    events: pa.RecordBatch
    first_frame: int


class FrameSelection(Windowed[Slice]):
    """A window over pieces: a frame is inside by its own time or number, an event by those of the frames around it.

    Args:
        window: what is wanted.
        again: gives the pieces once more, or None where that is impossible.
    """

    def __init__(self, window: Window, again: Callable[[], Iterable[Piece] | None] = lambda: None) -> None:
        super().__init__(window, lambda: None if (pieces := again()) is None else slices(pieces))

    def cut(self, pieces: Iterable[Piece]) -> Iterator[Piece]:
        """What of the pieces is inside the window."""
        for item, rows, _ in self.apply(slices(pieces)):
            frames, events = rows
            whole = len(frames) == len(item.frames) and len(events) == len(item.events)
            yield item.piece if whole else item.piece.pick(frames.tobytes(), events.tobytes())

    def _times(self, batch: Slice) -> tuple[Rows, ...]:
        return (numbers(batch.frames.column("t")),)

    def _pick(self, batch: Slice) -> tuple[Slice, Any, int | None]:
        picked = rows_inside(batch, self.window, self._limits())
        return batch, picked, self._zero()


class ListSelection(Selection):
    """A window over decoded batches that holds their events to it, too."""

    def _pick(self, batch: Batch) -> tuple[Batch, Any, int | None]:
        batch, rows, zero = super()._pick(batch)
        if self.window and len(batch.events):
            _, events = rows_inside(batch, self.window, self._limits())
            batch = replace(batch, events=batch.events.take(pa.array(events)))
        return batch, rows, zero


def rows_inside(part: Slice | Batch, window: Window, limits: tuple[int | None, int | None]) -> tuple[Rows, Rows]:
    """Rows (u32) of frames and of events that are inside a window with these limits of time."""
    times, lines = numbers(part.frames.column("t")), numbers(part.frames.column("line"))
    before = np.searchsorted(lines, numbers(part.events.column("line")))
    own = numbers(part.events.column("t"))
    low, high = limits
    late = np.array([NEVER], np.int64) if not len(times) else times
    event_times = np.where(own == NEVER, late[np.maximum(before - 1, 0)], own)
    wanted = []
    for t, numbers_ in ((times, np.arange(len(times))), (event_times, before)):
        keep = np.ones(len(t), bool)
        if low is not None:
            keep &= (t >= low) & (t != NEVER)
        if high is not None:
            keep &= (t <= high) & (t != NEVER)
        if window.frames is not None:
            counted = numbers_ + part.first_frame + 1
            keep &= (counted >= window.frames[0]) & (counted <= window.frames[1])
        wanted.append(np.flatnonzero(keep).astype(np.uint32))
    return wanted[0], wanted[1]


def slices(pieces: Iterable[Piece]) -> Iterator[Slice]:
    """The tables of each piece, frames numbered through."""
    count = 0
    for piece in pieces:
        frames, events = piece.columns()
        yield Slice(piece, wrap(RECORDED, frames), wrap(EVENT_ROWS, events), count)
        count += piece.frames
