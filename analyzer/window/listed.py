"""A part of a capture for a list: its transfers, the frames that form none, and what happened between them."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.tables import VERDICTS
from analyzer.window.cut import rows_inside
from analyzer.window.selection import NEVER, TransferSelection
from dissectors.kit.cells import numbers

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from analyzer.decode.engine import Batch, SelectedRows
    from analyzer.window.limits import Window
    from analyzer.window.numbering import Numbering
    from dissectors.kit import Array

_USED = VERDICTS.index("used")
_NONE = np.zeros(0, np.int64)
_BATCHES_KEPT = 4  # whose frames may still get another verdict


class ListedRows(NamedTuple):
    """Rows of a batch that a list shows.

    `transfers` are in the order of their first frames; `frames` form no transfer; `settled` are frames of earlier
    batches whose verdict changed only now, as rows of `Batch.settled`; `events` are error frames, losses and the like.
    """

    transfers: Array
    frames: Array
    settled: Array
    events: Array

    @classmethod
    def all_of(cls, batch: Batch) -> ListedRows:
        """Return all rows of a batch, transfers as they ended."""
        loose = np.flatnonzero(numbers(batch.frames.column("verdict")) != _USED)
        settled, events = np.arange(len(batch.settled)), np.arange(len(batch.events))
        return cls(np.arange(len(batch.transfers)), loose, settled, events)

    @classmethod
    def chosen_of(cls, batch: Batch) -> ListedRows:
        """Return all rows that a filter has chosen, all there are without one; transfers as they ended."""
        if batch.selected is None:
            return cls.all_of(batch)
        return cls(*map(np.flatnonzero, batch.selected))

    def of(self, selected: SelectedRows | None) -> ListedRows:
        """Return those that a filter has chosen, all without one."""
        if selected is None:
            return self
        return ListedRows(*(rows[mask[rows]] for rows, mask in zip(self, selected, strict=True)))


class ListSelection(TransferSelection):
    """A window over decoded batches that holds their frames and events to it, too."""

    def __init__(
        self,
        window: Window,
        again: Callable[[], Iterable[Batch] | None] = lambda: None,
        numbering: Numbering | None = None,
    ) -> None:
        super().__init__(window, again, numbering)
        self._kept: deque[tuple[int, Array]] = deque(maxlen=_BATCHES_KEPT)

    def frames(self, batches: Iterable[Batch]) -> Iterator[tuple[Batch, ListedRows, int | None]]:
        """Yield batches with all their frames inside the window, and no transfers."""
        for batch, _, zero in self.apply(batches):
            frames, events = rows_inside(batch, self.window, self._limits(), self.numbering)
            yield batch, ListedRows(_NONE, frames, _NONE, events), zero

    def picked(self, batches: Iterable[Batch]) -> Iterator[tuple[Batch, ListedRows, int | None]]:
        """Yield batches with their rows inside the window, and the time that is 0."""
        for batch, transfers, zero in self.apply(batches):
            if not self.window:
                yield batch, ListedRows.chosen_of(batch)._replace(transfers=transfers), zero
                continue
            frames, events = rows_inside(batch, self.window, self._limits(), self.numbering)
            self._kept.append((batch.first_frame, numbers(batch.frames.column("t"))))
            loose = frames[numbers(batch.frames.column("verdict"))[frames] != _USED]
            late = numbers(batch.settled.column("frame")).tolist()
            settled = [row for row, frame in enumerate(late) if self._has(frame)]
            rows = ListedRows(transfers, loose, np.array(settled, np.int64), events)
            yield batch, rows.of(batch.selected), zero

    def counted(self, batches: Iterable[Batch]) -> Iterator[tuple[Batch, ListedRows, int | None]]:
        """Yield what `picked` does, in no order where no window asks for one: rows that are counted, not listed."""
        if self.window:
            yield from self.picked(batches)
            return
        for batch in batches:
            yield batch, ListedRows.chosen_of(batch), None

    def _has(self, frame: int) -> bool:
        """Return whether a frame of an earlier batch is inside; one that is long gone is not."""
        window, (low, high) = self.window, self._limits()
        for first, times in self._kept:
            if first <= frame < first + len(times):
                t = int(times[frame - first])
                timed = low is not None or high is not None
                late = (low is not None and t < low) or (high is not None and t > high)
                named = window.frames is None or window.frames[0] <= self.numbering.of(frame) <= window.frames[1]
                return named and not (timed and (t == NEVER or late))
        return False
