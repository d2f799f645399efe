"""Find out if one capture is the beginning of another: frame by frame the same, and cut short."""

from __future__ import annotations

from hashlib import blake2b
from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit.cells import numbers

if TYPE_CHECKING:
    from analyzer.decode.engine import Batch
    from dissectors.kit import Array

_BLOCK = 512  # frames; fewer at the end of the shorter capture are not compared


class FrameBlocks:
    """Adds up batches to a digest for each block of frames: times, identifiers and bytes."""

    def __init__(self) -> None:
        self._digests: list[bytes] = []
        self._open, self._missing = blake2b(digest_size=8), _BLOCK

    def feed(self, batch: Batch) -> None:
        """Add the frames of the next batch."""
        if not len(batch.frames):
            return
        t, ids = numbers(batch.frames.column("t")).astype(np.int64), numbers(batch.frames.column("id"))
        column = batch.frames.column("data")
        ends = np.frombuffer(column.buffers()[1], np.int32)[column.offset : column.offset + len(column) + 1]
        data = memoryview(column.buffers()[2] or b"")
        start = 0
        while start < len(t):
            stop = min(start + self._missing, len(t))
            self._add(t[start:stop], ids[start:stop], data[int(ends[start]) : int(ends[stop])])
            start = stop

    def _add(self, t: Array, ids: Array, data: memoryview) -> None:
        for some in (t.tobytes(), ids.tobytes(), data):
            self._open.update(some)
        self._missing -= len(t)
        if not self._missing:
            self._digests.append(self._open.digest())
            self._open, self._missing = blake2b(digest_size=8), _BLOCK

    def begins(self, other: FrameBlocks) -> bool:
        """Return whether these frames are the first ones of another capture, which has more."""
        mine, theirs = self._digests, other._digests
        return bool(mine) and len(mine) < len(theirs) and mine == theirs[: len(mine)]
