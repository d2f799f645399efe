"""Rows inside a window, found while batches go by, with bounded waiting for a point that comes late."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from typing import TYPE_CHECKING, Generic, Protocol, TypeVar

import numpy as np

from analyzer.window.first_frames import first_frames
from analyzer.window.limits import Moment
from analyzer.window.numbering import Numbering
from dissectors.kit.cells import numbers

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    import pyarrow as pa

    from analyzer.decode.engine import Batch
    from analyzer.window.limits import Window
    from dissectors.kit import Array

NEVER = np.iinfo(np.int64).min  # a time that is not there
_NOTHING = int(np.iinfo(np.int64).max), NEVER
# Frames that wait, in their batches, for a point that is still to come; each takes some 230 bytes.
MOST_WAITING = 1 << 20


class HasFrames(Protocol):
    """Something that holds rows of the frames table, and the events between them."""

    @property
    def frames(self) -> pa.RecordBatch:
        """The frames, with their times in column `t`."""

    @property
    def events(self) -> pa.RecordBatch:
        """Error frames, losses and the like, with the line that each stands in."""

    @property
    def first_frame(self) -> int:
        """Number of the first one in the capture, from 0."""


F = TypeVar("F", bound=HasFrames)


class Selection(ABC, Generic[F]):
    """A window applied to the batches of a capture while they go by.

    Args:
        window: the limits.
        again: gives the batches once more, or None where that is impossible. Needed when more is wanted from before a
            point that is found late (the end, a frame) than `MOST_WAITING` frames.
        numbering: what a number of a frame means; it is told of every batch.

    `problem` says afterwards why the window does not fit the capture, None if it does.
    """

    def __init__(
        self,
        window: Window,
        again: Callable[[], Iterable[F] | None] = lambda: None,
        numbering: Numbering | None = None,
    ) -> None:
        self.window = window
        self.numbering = numbering or Numbering()
        self.problem: str | None = None
        self._again = again
        self._first: int | None = None
        self._latest: int | None = None
        self._anchor: int | None = None
        self._met = False  # the frame that is wanted
        self._frames = 0
        self._waiting: deque[tuple[F, int]] = deque()
        self._held = 0
        self._dropped = NEVER

    @property
    def first(self) -> int | None:
        """The first time of the capture, in nanoseconds; None while there is none."""
        return self._first

    def apply(self, batches: Iterable[F]) -> Iterator[tuple[F, Array, int | None]]:
        """Yield batches with the rows inside the window.

        The third value is the zero of relative times: the first frame's time, or that of `around`. Batches that are
        surely too early for a window that is found late are left out.
        """
        for batch in batches:
            newest = self._note(batch)
            if self._known():
                yield from self._release()
                yield self._pick(batch)
            else:
                self._hold(batch, newest)
        self._conclude()
        if self._lost():
            self._waiting.clear()
            batches_ = self._again()
            if batches_ is not None:
                yield from map(self._pick, batches_)
                return
            self.problem = "the window is too wide for a pipe: save the capture to a file first"
        yield from self._release()

    def _note(self, batch: F) -> int:
        """Note what a window needs of a batch; return the newest time of its frames and transfers."""
        newest = self._note_times(batch) if self.window or self._first is None else NEVER
        self._frames = batch.first_frame + len(batch.frames)
        self.numbering.feed(batch.first_frame, batch.frames, batch.events)
        self._find_anchor(batch)
        return newest

    def _note_times(self, batch: F) -> int:
        newest = NEVER
        for column in self._times(batch):
            times = column[column != NEVER]
            if times.size:
                newest = max(newest, int(times.max()))
        if newest != NEVER:
            if self._first is None and times.size:
                self._first = int(times[0])
            self._latest = newest if self._latest is None else max(self._latest, newest)
        return newest

    @abstractmethod
    def _times(self, batch: F) -> tuple[Array, ...]:
        """Return all times of a batch, those of its frames last."""

    @abstractmethod
    def _pick(self, batch: F) -> tuple[F, Array, int | None]:
        """Return what `apply` gives for a batch."""

    def _known(self) -> bool:
        """Return whether rows can be picked already. Once batches are lost only a second reading gets them in order."""
        return (
            self.window.last is None and (self.window.around is None or self._anchor is not None) and not self._lost()
        )

    def _find_anchor(self, batch: F) -> None:
        around = self.window.around
        if around is None or self._anchor is not None or self._met or self._first is None:
            return
        if isinstance(around, Moment):
            moment = around.at(self._first)
            if around.fits(self._first) and self._latest is not None and self._latest >= moment:
                self._anchor = moment
        elif len(batch.frames) and around <= self.numbering.of(self._frames - 1):
            row = int(np.searchsorted(self.numbering.of_all(np.arange(batch.first_frame, self._frames)), around))
            self._anchor = batch.frames.column("t").cast("int64")[row].as_py()
            self._met = True

    def _hold(self, batch: F, newest: int) -> None:
        """Keep a batch until it is known whether it is wanted; one that is too old stays as the past of the next."""
        self._waiting.append((batch, newest))
        self._held += len(batch.frames)
        width = self.window.margin if self.window.last is None else self.window.last
        while len(self._waiting) > 2:
            recent = self._latest is not None and self._waiting[1][1] >= self._latest - width
            if recent and self._held <= MOST_WAITING:
                return
            old, time_ = self._waiting.popleft()
            self._held -= len(old.frames)
            if recent:
                self._dropped = max(self._dropped, time_)

    def _lost(self) -> bool:
        """Return whether something was dropped that is inside the window after all."""
        low, _ = self._limits()
        return self._dropped != NEVER and (low is None or self._dropped >= low)

    def _release(self) -> Iterator[tuple[F, Array, int | None]]:
        while self._waiting:
            yield self._pick(self._waiting.popleft()[0])

    def _conclude(self) -> None:
        """Take the end of the capture: what was not found until now is not there."""
        window = self.window
        if window.timed and self._frames and self._first is None:
            self.problem = "without times: only --frames and -c can choose a part of it"
        elif self._first is not None and any(
            isinstance(m, Moment) and not m.fits(self._first) for m in (window.start, window.stop, window.around)
        ):
            self.problem = "its times are relative: give seconds from the first frame"
        elif isinstance(window.around, Moment) and self._first is not None:
            self._anchor = window.around.at(self._first)
        elif window.around is not None and self._anchor is None:
            wanted = 1 if isinstance(window.around, Moment) else window.around
            last = self.numbering.of(self._frames - 1)
            self.problem = (
                f"frame {wanted} has no time: --around cannot tell what is near"
                if wanted <= last
                else f"no frame {wanted}: the capture has {last}"
            )

    def _zero(self) -> int | None:
        return self._first if self._anchor is None else self._anchor

    def _limits(self) -> tuple[int | None, int | None]:
        """Return bounds in nanoseconds; bounds that nothing meets where the times needed are not there."""
        window, lows, highs = self.window, list[int](), list[int]()
        if window.timed and self._first is None:
            return _NOTHING
        for moment, bounds in ((window.start, lows), (window.stop, highs)):
            if moment is not None and self._first is not None:
                if not moment.fits(self._first):
                    return _NOTHING
                bounds.append(moment.at(self._first))
        if window.last is not None and self._latest is not None:
            lows.append(self._latest - window.last)
        if window.around is not None:
            if self._anchor is None:
                return _NOTHING
            lows.append(self._anchor - window.margin)
            highs.append(self._anchor + window.margin)
        return max(lows, default=None), min(highs, default=None)


class TransferSelection(Selection["Batch"]):
    """A window over decoded batches: rows are those of their transfers, in order of the first frames."""

    def _times(self, batch: Batch) -> tuple[Array, ...]:
        return numbers(batch.transfers.column("t_end")), numbers(batch.frames.column("t"))

    def _pick(self, batch: Batch) -> tuple[Batch, Array, int | None]:
        zero = self._zero()
        window, transfers = self.window, batch.transfers
        if not len(transfers):
            return batch, np.zeros(0, np.int64), zero
        t, t_end = numbers(transfers.column("t")), numbers(transfers.column("t_end"))
        keep = np.ones(len(transfers), bool) if batch.selected is None else batch.selected.transfers.copy()
        low, high = self._limits()
        if low is not None:
            keep &= (t_end >= low) & (t_end != NEVER)
        if high is not None:
            keep &= (t <= high) & (t != NEVER)
        if window.frames is not None:
            number = self.numbering.of_all
            first = first_frames(transfers)
            offsets = np.frombuffer(transfers.column("frame").buffers()[1], np.int32)[: len(transfers) + 1]
            last = numbers(transfers.column("frame").values)[offsets[1:] - 1]
            keep &= (number(last) >= window.frames[0]) & (number(first) <= window.frames[1])
        rows = np.flatnonzero(keep)
        return batch, rows[np.argsort(first_frames(transfers, rows), kind="stable")], zero
