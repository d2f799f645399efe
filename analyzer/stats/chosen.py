"""The transfers and frames of a batch that a statistic is made of: all, or those that a filter lets through."""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np
import pyarrow as pa

from analyzer.facts.traffic import times
from analyzer.rules.load import bit_times
from analyzer.tables import EXTENDED, REMOTE, VERDICTS
from dissectors.kit import FrameTable, by_key
from dissectors.kit.cells import numbers

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from analyzer.decode.engine import Batch
    from analyzer.filter.matcher import Matcher, Matches
    from dissectors.kit import Array

# Frames that are remembered, in batches: transfers that end later, and verdicts that are found out later, name them.
_FRAMES = 1 << 18
_BATCHES = 4
_MOST_BATCHES = 1024
_USED = VERDICTS.index("used")
_NOTHING = np.zeros(0, np.int64)


class ChosenFrames(NamedTuple):
    """Frames as columns. `size` is data bytes, `bits` how long a frame occupies its bus, `t` nanoseconds if `timed`."""

    bus: Array
    id: Array
    flags: Array
    verdict: Array
    size: Array
    bits: Array
    t: Array
    timed: Array

    def take(self, rows: Array | slice) -> Self:
        """Return some of them."""
        return type(self)(*(column[rows] for column in self))


def alike(rows: ChosenFrames, part: Array | None = None) -> tuple[Array, Array]:
    """Return the places of frames so that those of one sender, type and verdict stand together; and where each begins.

    With a `part` of each frame, a small number, only those of one part. What is alike has one identifier but for the
    priority, so that nothing has to be found out of each frame.
    """
    key = rows.id.astype(np.int64)
    key &= 0xFF_FFFF
    key |= (rows.flags & EXTENDED).astype(np.int64) << 24
    key |= rows.verdict.astype(np.int64) << 25
    key |= rows.bus.astype(np.int64) << 29
    if part is not None:
        key |= part << 37
    return by_key(key)


class ChosenBatch:
    """A batch with what was chosen of it.

    `changes` are frames to count, of this batch or of earlier ones, and whether to count them as more (1) or less (-1):
    verdicts are found out later, too. `rows` are the transfers chosen, None for all of them; `frames` are all frames of
    the batch.
    """

    def __init__(
        self, batch: Batch, frames: ChosenFrames, changes: Sequence[tuple[ChosenFrames, int]], rows: Array | None = None
    ) -> None:
        self.batch, self.frames, self.rows = batch, frames, rows
        self.changes = changes

    @cached_property
    def whole(self) -> Batch:
        """The batch, with no other transfers than those chosen; messages are all there."""
        if self.rows is None:
            return self.batch
        return replace(self.batch, transfers=self.batch.transfers.take(pa.array(self.rows)))


class Chooser:
    """Chooses transfers and frames, batch by batch: all of them, or those that a filter lets through.

    Frames are asked one by one: with what their transfer says, and with what only they say, such as their length.

    Args:
        matcher: the filter at work on this capture.
        note: is told what it matches in each batch.
    """

    def __init__(self, matcher: Matcher | None = None, note: Callable[[Matches], None] | None = None) -> None:
        self._matcher, self._note = matcher, note
        self._log = FrameLog()

    def feed(self, batch: Batch, frames: ChosenFrames) -> ChosenBatch:
        """Take the next batch, and its frames; return what is chosen."""
        self._log.feed(batch.first_frame, frames, taken=self._matcher is None)
        places = numbers(batch.settled.column("frame")).astype(np.int64) if len(batch.settled) else _NOTHING
        verdicts = numbers(batch.settled.column("verdict")) if len(places) else _NOTHING
        if self._matcher is None:
            changes = [(frames, 1)]
            if len(places):
                changes.append((self._log.take(places, wanted=False), -1))
                self._log.settle(places, verdicts)
                changes.append((self._log.take(places, wanted=True), 1))
            return ChosenBatch(batch, frames, changes)
        matches = self._matcher.feed(batch)
        if self._note is not None:
            self._note(matches)
        rows = np.flatnonzero(matches.transfers)
        loose = np.flatnonzero(frames.verdict != _USED)
        wanted = [loose[matches.loose(loose)] + batch.first_frame if len(loose) else loose]
        less = self._log.take(places, wanted=False)
        if len(places):
            self._log.settle(places, verdicts)
            wanted.append(places[matches.settled & (verdicts != _USED)])
        if len(rows):
            members, match = matches.members
            wanted.append(members[match])
        more = self._log.take(np.concatenate(wanted), wanted=True)
        return ChosenBatch(batch, frames, [(less, -1), (more, 1)], rows)


class _Kept(NamedTuple):
    """Frames of a batch, and which of them are counted now."""

    first: int
    rows: ChosenFrames
    taken: Array


class FrameLog:
    """Remembers frames of the last batches by number, as far as anything may still name them."""

    def __init__(self) -> None:
        self._kept: deque[_Kept] = deque()
        self._count = 0

    def feed(self, first: int, rows: ChosenFrames, *, taken: bool) -> None:
        """Keep the frames of the next batch, which are counted already or not."""
        if len(rows.bus):
            own = rows._replace(verdict=rows.verdict.copy())
            self._kept.append(_Kept(first, own, np.full(len(rows.bus), taken)))
            self._count += len(rows.bus)
        while len(self._kept) > _BATCHES:
            oldest = len(self._kept[0].taken)
            if self._count - oldest < _FRAMES and len(self._kept) <= _MOST_BATCHES:
                break
            self._kept.popleft()
            self._count -= oldest

    def settle(self, places: Array, verdicts: Array) -> None:
        """Give frames the verdicts that were found out now."""
        for one in self._kept:
            inside = _inside(one, places)
            one.rows.verdict[places[inside] - one.first] = verdicts[inside]

    def take(self, places: Array, *, wanted: bool) -> ChosenFrames:
        """Return frames by their numbers from 0 and count them from now on, those that were not; or the other way."""
        parts = []
        for one in self._kept:
            at = np.unique(places[_inside(one, places)] - one.first)
            at = at[one.taken[at] != wanted]
            if len(at):
                one.taken[at] = wanted
                parts.append(one.rows.take(at))
        if not parts:
            return frame_rows(None)
        return ChosenFrames(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _inside(one: _Kept, places: Array) -> Array:
    return np.flatnonzero((places >= one.first) & (places < one.first + len(one.taken)))


def frame_rows(batch: Batch | None) -> ChosenFrames:
    """Return the frames of a batch, none without one."""
    if batch is None or not len(batch.frames):
        none = np.zeros(0, np.int64)
        return ChosenFrames(none, none, none, none, none, none, none, none.astype(bool))
    frames = batch.frames
    flags, data = numbers(frames.column("flags")), frames.column("data")
    size = np.diff(np.frombuffer(data.buffers()[1], np.int32)[data.offset : data.offset + len(data) + 1])
    remote = flags & REMOTE != 0
    if remote.any():
        size = np.where(remote, 0, size)
    bits = bit_times(FrameTable(frames)) if batch.bit_times is None else batch.bit_times
    t, timed = times(frames)
    verdict = numbers(frames.column("verdict"))
    return ChosenFrames(
        numbers(frames.column("bus")), numbers(frames.column("id")), flags, verdict, size, bits, t, timed
    )
