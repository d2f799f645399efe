"""Frames by number for as long as a transfer that they are part of may still end."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Generic, Protocol, TypeVar

import numpy as np
import pyarrow as pa

from analyzer.filter.values import ByteSpans
from dissectors.kit.cells import numbers, valid

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable

    from analyzer.decode.engine import Batch
    from analyzer.filter.fields import FieldRef
    from dissectors.kit import Array

T = TypeVar("T")
BROADCAST = 0xFF  # in place of the number of a unit: all of them
_BATCHES = 4  # that are kept whatever their size
_FRAMES = 1 << 17  # that are kept beside them, of smaller batches
_MOST_BATCHES = 256
# Columns of frames that a field is made of; its own if it is not here.
_MADE_OF = {
    "number": (), "delta": (), "len": ("data", "flags"), "epoch": ("t",), "relative": ("t",),
    "xtd": ("flags",), "rtr": ("flags",), "err": ("flags",),
}  # fmt: skip
_NODES = ("src", "dst", "node", "label")  # which the identifiers of frames without a transfer name


def columns_of(fields: Iterable[FieldRef]) -> frozenset[str]:
    """Return the columns of frames, of this batch or an earlier one, that fields need."""
    found: set[str] = set()
    for ref in fields:
        if ref.origin == "frame":
            found.update(_MADE_OF.get(ref.column, (ref.column,)))
        elif ref.column in _NODES:
            found.update(("id", "flags"))
    return frozenset(found)


class LastBatches(Generic[T]):
    """Something of the frames of each of the last batches.

    Attributes:
        pairs: the number of a batch's first frame, and what is kept of it.
    """

    def __init__(self) -> None:
        self.pairs: deque[tuple[int, T]] = deque()
        self._sizes: deque[int] = deque()
        self._count = 0

    def add(self, first: int, size: int, kept: T) -> None:
        """Keep what there is of the `size` frames of the next batch."""
        self.pairs.append((first, kept))
        self._sizes.append(size)
        self._count += size
        while len(self.pairs) > _BATCHES:
            oldest = self._sizes[0]
            if self._count - oldest < _FRAMES and len(self.pairs) <= _MOST_BATCHES:
                break
            self.pairs.popleft()
            self._sizes.popleft()
            self._count -= oldest


class FrameHistory:
    """Some columns of the frames of the last batches: `feed(batch)`, then their cells by the frames' numbers from 0."""

    def __init__(self, columns: Collection[str]) -> None:
        self._columns = sorted(columns)
        self._kept = LastBatches[pa.RecordBatch]()

    def feed(self, batch: Batch) -> None:
        """Keep the frames of the next batch."""
        if len(batch.frames) and self._columns:
            self._kept.add(batch.first_frame, len(batch.frames), batch.frames.select(self._columns))

    def column(self, name: str, places: Array) -> tuple[Array, Array | None]:
        """Return numbers of frames, and which frames are still known (None: all) and have one."""
        for first, frames in reversed(self._kept.pairs):
            if len(places) and places.min() >= first and places.max() < first + len(frames):
                column = frames.column(name)
                at = places - first
                return numbers(column)[at], valid(column)[at] if column.null_count else None
        found, has = np.zeros(len(places), np.int64), np.zeros(len(places), bool)
        for first, frames in self._kept.pairs:
            inside = np.flatnonzero((places >= first) & (places < first + len(frames)))
            if len(inside):
                column = frames.column(name)
                at = places[inside] - first
                found[inside], has[inside] = numbers(column)[at], valid(column)[at]
        return found, has

    def data(self, places: Array) -> tuple[ByteSpans, Array]:
        """Return the bytes of frames, and which are still known."""
        start, end, has = (np.zeros(len(places), kind) for kind in (np.int64, np.int64, bool))
        parts: list[Array] = []
        size = 0
        for first, frames in self._kept.pairs:
            inside = np.flatnonzero((places >= first) & (places < first + len(frames)))
            if not len(inside):
                continue
            spans = spans_of(frames.column("data"))
            at = places[inside] - first
            start[inside], end[inside], has[inside] = spans.start[at] + size, spans.end[at] + size, True
            parts.append(spans.buffer)
            size += len(spans.buffer)
        return ByteSpans(np.concatenate(parts) if len(parts) != 1 else parts[0], start, end) if parts else ByteSpans(
            np.zeros(0, np.uint8), start, end
        ), has


def spans_of(column: pa.Array) -> ByteSpans:
    """Return a binary column, or one of lists of bytes, as places in its buffer."""
    if not len(column):
        none = np.zeros(0, np.int64)
        return ByteSpans(np.zeros(0, np.uint8), none, none)
    buffers = column.buffers()
    ends = np.frombuffer(buffers[1], np.int32)[column.offset : column.offset + len(column) + 1].astype(np.int64)
    if hasattr(column, "values"):
        whole = numbers(column.values) if len(column.values) else np.zeros(0, np.uint8)
    else:
        whole = np.zeros(0, np.uint8) if buffers[2] is None else np.frombuffer(buffers[2], np.uint8)
    return ByteSpans(whole, ends[:-1], ends[1:])


class SeenBatch(Protocol):
    """A batch, and what has been found out about its rows."""

    @property
    def batch(self) -> Batch:
        """The batch."""

    @property
    def first_places(self) -> Array:
        """The number of each transfer's first frame, from 0."""

    @property
    def error_rows(self) -> Array:
        """The events that are error frames."""

    def of_type(self, table: str) -> Array:
        """Return which transfers are of the type of a table."""
