"""A part of a capture that is not decoded: windows over frames and events, for all that copies them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from analyzer.tables import EVENT_ROWS, FRAMES, wrap
from analyzer.window.selection import NEVER, Selection
from dissectors.kit.cells import numbers
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    import pyarrow as pa

    from analyzer._native import FrameBatch
    from analyzer.decode.engine import Batch
    from analyzer.window.limits import Window
    from analyzer.window.numbering import Numbering
    from dissectors.kit import Array


# A frame as its reader left it, before anybody judged it.
RECORDED = FRAMES.remove(FRAMES.get_field_index("anomaly")).remove(FRAMES.get_field_index("verdict"))


@dataclass(frozen=True, slots=True)
class FrameTables:
    """A frame batch with its tables; `first_frame` is the number of its first frame in the capture, from 0."""

    batch: FrameBatch
    frames: pa.RecordBatch
    events: pa.RecordBatch
    first_frame: int


class FrameSelection(Selection[FrameTables]):
    """A window over frame batches: frames are inside by their own time or number, events by those of frames around.

    Args:
        window: the limits.
        again: gives the batches once more, or None where that is impossible.
        chosen: gives masks of the frames and events that are wanted among them; all are without it.
    """

    def __init__(
        self,
        window: Window,
        again: Callable[[], Iterable[FrameBatch] | None] = lambda: None,
        chosen: Callable[[FrameTables], tuple[Array, Array]] | None = None,
    ) -> None:
        super().__init__(window, lambda: None if (batches := again()) is None else frame_tables(batches))
        self._chosen = chosen

    def cut(self, batches: Iterable[FrameBatch]) -> Iterator[FrameBatch]:
        """Yield the frame batches, cut to the window."""
        for item, rows, _ in self.apply(frame_tables(batches)):
            frames, events = rows
            whole = len(frames) == len(item.frames) and len(events) == len(item.events)
            yield item.batch if whole else item.batch.pick(frames.tobytes(), events.tobytes())

    def _times(self, batch: FrameTables) -> tuple[Array, ...]:
        return (numbers(batch.frames.column("t")),)

    def _pick(self, batch: FrameTables) -> tuple[FrameTables, Any, int | None]:
        frames, events = rows_inside(batch, self.window, self._limits(), self.numbering)
        if self._chosen is not None:
            wanted, beside = self._chosen(batch)
            frames, events = frames[wanted[frames]], events[beside[events]]
        return batch, (frames, events), self._zero()


def rows_inside(
    part: FrameTables | Batch, window: Window, limits: tuple[int | None, int | None], numbering: Numbering
) -> tuple[Array, Array]:
    """Return the rows (u32) of frames and of events that are inside a window with these limits of time."""
    if limits == (None, None) and window.frames is None:
        return np.arange(len(part.frames), dtype=np.uint32), np.arange(len(part.events), dtype=np.uint32)
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
            counted = numbering.of_all(numbers_ + part.first_frame)
            keep &= (counted >= window.frames[0]) & (counted <= window.frames[1])
        wanted.append(np.flatnonzero(keep).astype(np.uint32))
    return wanted[0], wanted[1]


def frame_tables(batches: Iterable[FrameBatch]) -> Iterator[FrameTables]:
    """Yield the tables of each batch, frames numbered through."""
    count = 0
    for batch in batches:
        frames, events = batch.columns()
        yield FrameTables(batch, wrap(RECORDED, frames), wrap(EVENT_ROWS, events), count)
        count += batch.frames
