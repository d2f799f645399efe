"""Frames whose verdicts may still change, kept on the disk until the capture has ended."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from analyzer.sinks.spool import Spool
from analyzer.tables import FRAMES
from dissectors.kit.cells import numbers

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from dissectors.kit import Array


_ROWS = "frame"
_STORED = FRAMES.append(pa.field(_ROWS, pa.uint64()))


class LateFrames:
    """Takes frames as they come and gives them back in the same order, with their final verdicts.

    An identifier may prove to be DroneCAN hours after its first frame, so frames cannot be written for good before the
    end. They wait in a nameless temporary file, some 15 bytes a frame; what is settled late, a few frames of each
    identifier, waits in memory.

    Args:
        folder: where the temporary file is made; None is where the system has them.
    """

    def __init__(self, folder: str | None) -> None:
        self._spool = Spool(_STORED, folder)
        self._settled: list[pa.RecordBatch] = []

    def feed(self, frames: pa.RecordBatch, rows: Array) -> None:
        """Take frames with their numbers, from 0. Raises `TargetError` when there is no room."""
        if len(frames):
            self._spool.feed(pa.RecordBatch.from_arrays([*frames.columns, pa.array(rows)], schema=_STORED))

    def feed_verdicts(self, settled: pa.RecordBatch) -> None:
        """Take verdicts of frames that came before."""
        if len(settled):
            self._settled.append(settled)

    def replay(self) -> Iterator[tuple[pa.RecordBatch, Array]]:
        """Give the frames once more, with their numbers."""
        late = _Late(self._settled)
        for stored in self._spool.replay():
            rows = numbers(stored.column(_ROWS))
            yield late.corrected(stored.select(FRAMES.names).cast(FRAMES), rows), rows

    def close(self) -> None:
        """Give the room back."""
        self._spool.close()


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
        verdict, anomaly = (numbers(frames.column(name)).copy() for name in ("verdict", "anomaly"))
        verdict[at[there]] = self._verdict[some][there]
        np.bitwise_or.at(anomaly, at[there], self._anomaly[some][there])
        for name, values in (("verdict", verdict), ("anomaly", anomaly)):
            k = FRAMES.get_field_index(name)
            frames = frames.set_column(k, FRAMES.field(k), pa.array(values))
        return frames
