"""The rows of a batch as a list has them: transfers, frames that form none, error frames and losses, by their place."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from analyzer.tables import EVENTS, VERDICTS
from dissectors.kit.cells import numbers

if TYPE_CHECKING:
    from analyzer.decode.engine import Batch
    from dissectors.kit import Array

TRANSFER, FRAME, SETTLED, EVENT = range(4)  # kinds of rows: the tables that hold them
_KIND_BITS = 2
_USED = VERDICTS.index("used")
_LISTED = tuple(EVENTS.index(name) for name in ("error frame", "drop", "gap"))


def first_of(transfers: pa.RecordBatch) -> Array:
    """Return the place of the first frame of each transfer, from 0 (i64); -1 for one without any."""
    if not len(transfers):
        return np.zeros(0, np.int64)
    frames = transfers.column("frame")
    ends = np.asarray(frames.offsets).astype(np.int64)
    places = numbers(frames.values).astype(np.int64)
    starts = np.minimum(ends[:-1], max(len(places) - 1, 0))
    found: Array = np.where(ends[1:] > ends[:-1], places[starts] if len(places) else -1, -1)
    return found


def ordered(batch: Batch) -> pa.RecordBatch:
    """Return the rows of a batch: `key`, which is kind and row in its table, and the `place` of the first frame."""
    parts = [(TRANSFER, np.arange(len(batch.transfers)), first_of(batch.transfers))]
    loose = np.flatnonzero(numbers(batch.frames.column("verdict")) != _USED)
    parts.append((FRAME, loose, loose + batch.first_frame))
    if len(batch.settled):
        late = np.flatnonzero(numbers(batch.settled.column("verdict")) != _USED)
        parts.append((SETTLED, late, numbers(batch.settled.column("frame")).astype(np.int64)[late]))
    if len(batch.events):
        some = np.flatnonzero(np.isin(numbers(batch.events.column("kind")), _LISTED))
        lines = numbers(batch.events.column("line"))[some]
        before = np.searchsorted(numbers(batch.frames.column("line")), lines)
        parts.append((EVENT, some, before + batch.first_frame))
    key = np.concatenate([rows.astype(np.uint32) << _KIND_BITS | kind for kind, rows, _ in parts])
    place = np.concatenate([places.astype(np.int64) for _, _, places in parts])
    # What happened before a frame stands before it.
    order = np.argsort(place * 2 + ((key & (1 << _KIND_BITS) - 1) != EVENT), kind="stable")
    return pa.RecordBatch.from_arrays([pa.array(key[order]), pa.array(place[order])], ["key", "place"])


def split(keys: Array) -> tuple[Array, Array]:
    """Return kinds and rows of keys."""
    return keys & (1 << _KIND_BITS) - 1, (keys >> _KIND_BITS).astype(np.int64)


class Sessions:
    """Finds for each transfer the one before of the same sender and type: `feed(transfers, first)` in order."""

    def __init__(self) -> None:
        self._last = np.full(1 << 18, -1, np.int64)
        self._codes: dict[int, int] = {}

    def feed(self, transfers: pa.RecordBatch, first: int) -> Array:
        """Return the number of the transfer before each, from 0, -1 for none; `first` is that of the first row."""
        count = len(transfers)
        if not count:
            return np.zeros(0, np.int64)
        names = ("bus", "kind", "type_id", "src", "dst")
        bus, kind, type_id, src, dst = (numbers(transfers.column(n)).astype(np.int64) for n in names)
        service = kind >= 2
        key = bus << 40 | kind << 36 | type_id << 16 | src << 8 | np.where(service, dst, 0)
        codes, inverse = np.unique(key, return_inverse=True)
        order = np.argsort(inverse, kind="stable")
        before = np.full(count, -1, np.int64)
        same = inverse[order[1:]] == inverse[order[:-1]]
        before[order[1:][same]] = order[:-1][same] + first
        starts = order[np.concatenate(([True], ~same))]
        ends = order[np.concatenate((~same, [True]))]
        for code, start, end in zip(codes.tolist(), starts.tolist(), ends.tolist(), strict=True):
            at = self._codes.setdefault(code, len(self._codes))
            if at < len(self._last):
                before[start] = self._last[at]
                self._last[at] = end + first
        return before
