"""The store: batches go in while they are decoded, rows come out by their number."""

from __future__ import annotations

import errno
from bisect import bisect_right
from collections import OrderedDict
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.browser.store.order import FRAME, SETTLED, TRANSFER, Sessions, split
from analyzer.browser.store.segment import OpenSegment, write
from dissectors.kit.cells import valid

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    import pyarrow as pa

    from analyzer.browser.store.segment import Segment
    from analyzer.decode.engine import Batch
    from dissectors.kit import Array

_OPEN = 6  # segments that are mapped at a time
_AHEAD = 64  # segments in which the rest of a transfer is looked for


class StoreFullError(Exception):
    """The store cannot be written; says why in one line."""


class ListRow(NamedTuple):
    """A row of the list: which segment, its place in its list there, its kind and its row in that table."""

    segment: int
    local: int
    kind: int
    entry: int
    place: int


class TableStore:
    """All tables of a capture, in files of a folder. One thread adds, others read what is there.

    Attributes:
        segments: one for each batch.
        starts: the number of the first row of each segment, and of all rows.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.segments: list[Segment] = []
        self.starts: list[int] = [0]
        self._sessions = Sessions()
        self._opened: OrderedDict[int, OpenSegment] = OrderedDict()
        self._count = 0
        self.low: int | None = None
        self.high: int | None = None

    def add(self, batch: Batch) -> None:
        """Write the next batch. Raises `StoreFullError`."""
        path = self._folder / f"{len(self.segments):06}.arrow"
        last = self.segments[-1] if self.segments else None
        try:
            segment = write(path, batch, self._sessions.feed(batch.transfers, batch.first_transfer), last)
        except OSError as error:
            full = error.errno in (errno.ENOSPC, errno.EDQUOT)
            reason = "the disk is full" if full else error.strerror or str(error)
            hint = "; TMPDIR names another place" if full else ""
            raise StoreFullError(f"{self._folder.parent}: {reason}: what fits is shown{hint}") from None
        if segment.low is not None and segment.high is not None:
            self.low = segment.low if self.low is None else min(self.low, segment.low)
            self.high = segment.high if self.high is None else max(self.high, segment.high)
        self._count += segment.frames
        self.segments.append(segment)
        self.starts.append(self.starts[-1] + segment.rows)

    def __len__(self) -> int:
        """Count the rows that are there."""
        return self.starts[-1]

    @property
    def zero(self) -> int | None:
        """The time in nanoseconds that relative times count from: of the first frame of the whole capture."""
        first = self.segments[0].zero if self.segments else None
        return self.low if first is None else first

    @property
    def count(self) -> int:
        """How many frames are there."""
        return self._count

    @property
    def first(self) -> int:
        """The place of the first frame, from 0: a part of a capture keeps those of the whole."""
        return self.segments[0].first_frame if self.segments else 0

    @property
    def frames(self) -> int:
        """The place behind the last frame."""
        return self.segments[-1].first_frame + self.segments[-1].frames if self.segments else 0

    @property
    def buses(self) -> tuple[str, ...]:
        """Interfaces by index, as far as they are known."""
        return self.segments[-1].buses if self.segments else ()

    def opened(self, at: int) -> OpenSegment:
        """Return a segment, mapped; the last few stay so. For one thread."""
        if at not in self._opened:
            self._opened[at] = OpenSegment(self.segments[at])
            while len(self._opened) > _OPEN:
                self._opened.popitem(last=False)
        self._opened.move_to_end(at)
        return self._opened[at]

    def batches(self) -> Iterator[Batch]:
        """Yield the batches that are there, in order; for another thread than that of `opened`."""
        for segment in self.segments[:]:
            yield OpenSegment(segment).batch

    def locate(self, number: int) -> tuple[int, int]:
        """Return segment and place in it of a row, by its number from 0."""
        at = bisect_right(self.starts, number) - 1
        return at, number - self.starts[at]

    def row(self, at: int, local: int) -> ListRow:
        """Return a row of a segment."""
        one = self.opened(at)
        kind, index = split(one.column("rows", "key")[local : local + 1])
        return ListRow(at, local, int(kind[0]), int(index[0]), int(one.column("rows", "place")[local]))

    def time(self, row: ListRow) -> int | None:
        """Return the time of a row in nanoseconds."""
        table, index = ("transfers", "frames", "settled", "events")[row.kind], row.entry
        if row.kind == SETTLED:
            return self.frame_time(row.place)
        column = self.opened(row.segment).table(table).column("t")
        value = column[index]
        return int(value.value) if value.is_valid else None

    def frame_time(self, place: int) -> int | None:
        """Return the time of a frame, by its place from 0."""
        at = self.segment_of(place)
        if at is None:
            return None
        value = self.opened(at).table("frames").column("t")[place - self.segments[at].first_frame]
        return int(value.value) if value.is_valid else None

    def segment_of(self, place: int) -> int | None:
        """Return the segment that holds a frame."""
        low, high = 0, len(self.segments)
        while low < high:
            middle = (low + high) // 2
            one = self.segments[middle]
            if place >= one.first_frame + one.frames:
                low = middle + 1
            else:
                high = middle
        return low if low < len(self.segments) and place >= self.segments[low].first_frame else None

    def segment_of_transfer(self, number: int) -> int | None:
        """Return the segment that holds a transfer, by its number from 0."""
        at = bisect_right(self.segments, number, key=lambda one: one.first_transfer) - 1
        return at if at >= 0 and number < self.segments[at].first_transfer + self.segments[at].transfers else None

    def local_of(self, at: int, kind: int, index: int) -> int | None:
        """Return the place in a segment's list of a row of one of its tables."""
        found = np.flatnonzero(self.opened(at).column("rows", "key") == (index << 2 | kind))
        return int(found[0]) if len(found) else None

    def row_of_frame(self, place: int) -> tuple[int, int] | None:
        """Return segment and place in it of the row that shows a frame, else of the first one behind it."""
        first = self.segment_of(place)
        if first is None:
            return None
        for at in range(first, min(first + _AHEAD, len(self.segments))):
            one = self.opened(at)
            places = one.column("rows", "place")
            local = int(np.searchsorted(places, place))
            for near in range(local, len(places)):
                if places[near] != place:
                    break
                if int(one.column("rows", "key")[near]) & 3 in (TRANSFER, FRAME, SETTLED):
                    return at, near
            owner = owner_of(one.table("transfers"), place)
            if owner is not None:
                found = self.local_of(at, TRANSFER, owner)
                if found is not None:
                    return at, found
        one = self.opened(first)
        behind = int(np.searchsorted(one.column("rows", "place"), place))
        return first, min(behind, max(self.segments[first].rows - 1, 0))

    def row_at_time(self, t: int) -> tuple[int, int] | None:
        """Return segment and place in it of the first row at or after a time, the last one if there is none."""
        last = None
        for at, segment in enumerate(self.segments):
            if not segment.rows:
                continue
            last = at
            if segment.high is None or segment.high < t:
                continue
            times, known = self.times(at)
            found = np.flatnonzero(known & (times >= t))
            if len(found):
                return at, int(found[0])
        return None if last is None else (last, self.segments[last].rows - 1)

    def times(self, at: int) -> tuple[Array, Array]:
        """Return the times of all rows of a segment in nanoseconds, and which have one."""
        one = self.opened(at)
        kinds, index = split(one.column("rows", "key"))
        times, known = np.zeros(len(kinds), np.int64), np.zeros(len(kinds), bool)
        for kind, name in ((TRANSFER, "transfers"), (FRAME, "frames"), (3, "events")):
            rows = kinds == kind
            if rows.any():
                column = one.table(name).column("t")
                times[rows], known[rows] = one.column(name, "t")[index[rows]], valid(column)[index[rows]]
        return times, known


def owner_of(transfers: pa.RecordBatch, place: int) -> int | None:
    """Return the row of the transfer that has a frame."""
    if not len(transfers):
        return None
    frames = transfers.column("frame")
    values = np.asarray(frames.values)
    found = np.flatnonzero(values == np.uint64(place))
    if not len(found):
        return None
    return int(np.searchsorted(np.asarray(frames.offsets), found[0] + frames.values.offset, "right")) - 1
