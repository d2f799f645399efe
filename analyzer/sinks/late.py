"""Frames whose verdicts may still change: a few wait in memory, many on the disk until the capture has ended."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from analyzer.decode.verdicts import with_verdicts
from analyzer.sinks.spool import Spool
from analyzer.tables import FRAMES
from dissectors.kit.cells import numbers

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from dissectors.kit import Array


_ROWS = "frame"
_STORED = FRAMES.append(pa.field(_ROWS, pa.uint64()))
# Frames that wait in memory, some 50 bytes each: as many as the frames of another protocol that go by while it is found
# out whose a rare identifier is.
MOST_WAITING = 1 << 18


class LateFrames:
    """Takes frames as they come and gives them back in the same order, with their final verdicts.

    An identifier may prove to be DroneCAN hours after its first frame, and from there on no frame can be written for
    good. Frames wait for that in memory; once they are more than `MOST_WAITING`, they and all that follow wait for the
    end in a nameless temporary file, some 15 bytes a frame. What is settled late, a few frames of each identifier,
    waits in memory.

    Args:
        folder: where the temporary file is made; None is where the system has them.
    """

    def __init__(self, folder: str | None) -> None:
        self._folder = folder
        self._waiting: deque[tuple[pa.RecordBatch, Array]] = deque()
        self._spool: Spool | None = None
        self._settled: list[pa.RecordBatch] = []

    def feed(self, frames: pa.RecordBatch, rows: Array) -> None:
        """Take frames with their numbers, from 0."""
        if len(frames):
            self._waiting.append((frames, rows))

    def feed_verdicts(self, settled: pa.RecordBatch) -> None:
        """Take verdicts of frames that came before."""
        if len(settled):
            self._settled.append(settled)

    def settled(self, before: int) -> Iterator[tuple[pa.RecordBatch, Array]]:
        """Give frames that need not wait any longer, now that those before this number have their last verdicts.

        Raises `TargetError` when there is no room for the others.
        """
        if self._spool is None:
            late = _Late(self._settled)
            while self._waiting and self._waiting[0][1][-1] < before:
                frames, rows = self._waiting.popleft()
                yield late.corrected(frames, rows), rows
            if not self._waiting:
                self._settled.clear()
            if sum(len(rows) for _, rows in self._waiting) > MOST_WAITING:
                self._spool = Spool(_STORED, self._folder)
        if self._spool is not None:
            for frames, rows in self._in_memory():
                self._spool.feed(pa.RecordBatch.from_arrays([*frames.columns, pa.array(rows)], schema=_STORED))

    def replay(self) -> Iterator[tuple[pa.RecordBatch, Array]]:
        """Give what still waits, with its numbers, after the last verdict. Raises `TargetError`."""
        late = _Late(self._settled)
        for frames, rows in self._in_memory() if self._spool is None else self._spooled(self._spool):
            yield late.corrected(frames, rows), rows

    def close(self) -> None:
        """Give the room back."""
        if self._spool is not None:
            self._spool.close()

    def _in_memory(self) -> Iterator[tuple[pa.RecordBatch, Array]]:
        while self._waiting:
            yield self._waiting.popleft()

    def _spooled(self, spool: Spool) -> Iterator[tuple[pa.RecordBatch, Array]]:
        for stored in spool.replay():
            yield stored.select(FRAMES.names).cast(FRAMES), numbers(stored.column(_ROWS))


class _Late:
    """All late verdicts, by frame number; of several for one frame the last one holds, anomalies add up."""

    def __init__(self, settled: Sequence[pa.RecordBatch]) -> None:
        table = pa.Table.from_batches(settled).combine_chunks() if settled else None
        columns = [np.zeros(0, np.uint64)] * 3 if table is None else [c.to_numpy() for c in table.columns]
        order = np.argsort(columns[0], kind="stable")
        self._frame, self._verdict, self._anomaly = (column[order] for column in columns)

    def corrected(self, frames: pa.RecordBatch, rows: Array) -> pa.RecordBatch:
        low, high = np.searchsorted(self._frame, [rows[0], rows[-1] + np.uint64(1)])
        some = slice(int(low), int(high))
        at = np.searchsorted(rows, self._frame[some])
        there = rows[at.clip(max=len(rows) - 1)] == self._frame[some]
        if not there.any():
            return frames
        return with_verdicts(frames, at[there], self._verdict[some][there], self._anomaly[some][there])
