"""The part of a capture that is to be played: looked through before, and there as often as it is needed."""

from __future__ import annotations

from itertools import chain
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from analyzer.live.replay.player import ReplayBatch
from analyzer.tables import EVENTS, EXTENDED, REMOTE
from analyzer.window.cut import frame_tables
from dissectors.kit.cells import numbers, valid
from dissectors.records import dataclass, field

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    import numpy.typing as npt

    from analyzer.app.run import Run
    from analyzer.live.interfaces.filters import Filters
    from analyzer.window.cut import FrameTables
    from dissectors.kit import Array

# Frames that are kept in memory, some 40 bytes each: nothing is read any more while they are sent.
MOST_HELD = 1 << 21
_ERROR_FRAME, _DROP = EVENTS.index("error frame"), EVENTS.index("drop")
# An identifier with the bits that SocketCAN puts above it, made of the flags.
_FLAGS = ((EXTENDED, 1 << 31), (REMOTE, 1 << 30))


@dataclass(slots=True)
class Reel:
    """The frames of a run that are inside its window and pass the filters.

    `longest` shortens silences as the player does: `length` is the time (ns) that takes at normal speed, `silence` the
    longest pause that is left. Both are about what has been looked at, which is all of it if `whole`.
    """

    run: Run
    filters: Filters
    longest: int | None = None
    frames: int = 0
    buses: list[str] = field(default_factory=list)
    length: int = 0
    silence: int = 0
    whole: bool = False
    _held: list[ReplayBatch] = field(default_factory=list)
    _rest: Iterator[ReplayBatch] | None = None
    _latest: int | None = None

    def look(self, each: Callable[[ReplayBatch], None], *, far: bool) -> Iterator[None]:
        """Read ahead, a step at a time: as much as can be kept, `far` to the end. `each` is shown every part."""
        self._rest = self._parts()
        for part in self._rest:
            self._note(part)
            each(part)
            if self.frames <= MOST_HELD:
                self._held.append(part)
            elif far:
                self._held.clear()
            else:
                self._held.append(part)
                return
            yield
        self.whole = True
        if self.frames > MOST_HELD:
            self._rest = None

    def rounds(self, count: int | None) -> Iterator[Iterator[ReplayBatch]]:
        """Yield the parts, so many times over, None without end. Ends the run if that cannot be done."""
        done = 0
        while (count is None or done < count) and not self.run.stopped:
            yield self._round(first=not done)
            done += 1

    def _round(self, *, first: bool) -> Iterator[ReplayBatch]:
        if self._held and self.whole:
            return iter(self._held)
        if first and self._rest is not None:
            held, self._held = self._held, []
            return chain(held, self._rest)
        return self._parts(again=not first or self.whole)

    def _parts(self, *, again: bool = False) -> Iterator[ReplayBatch]:
        yield from map(self._part, frame_tables(self.run.frame_batches_inside(again=again)))

    def _part(self, item: FrameTables) -> ReplayBatch:
        frames, events = item.frames, item.events
        if self.filters.frames:
            frames = frames.filter(pa.array(self._passing(words(frames))))
        kinds, classes = numbers(events.column("kind")), numbers(events.column("class"))
        errors = kinds == _ERROR_FRAME
        if self.filters.errors is not None:
            errors &= classes & self.filters.errors != 0
        return ReplayBatch(frames, item.batch.buses, int(errors.sum()), int(classes[kinds == _DROP].sum()))

    def _passing(self, found: Array) -> npt.NDArray[np.bool_]:
        different, where = np.unique(found, return_inverse=True)
        return np.array([self.filters.passes(word) for word in different.tolist()], bool)[where]

    def _note(self, part: ReplayBatch) -> None:
        self.frames += len(part.frames)
        for bus in np.unique(numbers(part.frames.column("bus"))).tolist():
            if part.buses[bus] not in self.buses:
                self.buses.append(part.buses[bus])
        column = part.frames.column("t")
        times = numbers(column)[valid(column)].astype(np.int64)
        if len(times):
            gaps = np.maximum(np.diff(times, prepend=times[0] if self._latest is None else self._latest), 0)
            gaps = gaps if self.longest is None else np.minimum(gaps, self.longest)
            self.length += int(gaps.sum())
            self.silence = max(self.silence, int(gaps.max()))
            self._latest = int(times[-1])


def words(frames: pa.RecordBatch) -> Array:
    """Return identifiers with their flag bits, as SocketCAN has them."""
    flags = numbers(frames.column("flags"))
    found = numbers(frames.column("id")).copy()
    for flag, bit in _FLAGS:
        found |= np.where(flags & flag, np.uint32(bit), np.uint32(0))
    return found
