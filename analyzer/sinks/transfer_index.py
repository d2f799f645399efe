"""The transfers that hold frames, for those who only know at the end which frames they ask for."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from analyzer.sinks.spool import Spool
from dissectors.kit.cells import numbers

if TYPE_CHECKING:
    from collections.abc import Collection

    from analyzer.decode.engine import Batch

_SCHEMA = pa.schema([("frame", pa.uint64()), ("transfer", pa.uint64())])


class TransferIndex:
    """Takes batches and keeps on the disk which transfer each frame is of, some bytes a frame.

    Args:
        folder: where the temporary file is made; None is where the system has them.
    """

    def __init__(self, folder: str | None = None) -> None:
        self._spool = Spool(_SCHEMA, folder)

    def feed(self, batch: Batch) -> None:
        """Take the transfers of a batch. Raises `TargetError` when there is no room."""
        held = batch.transfers.column("frame")
        if len(held):
            counts = np.diff(np.asarray(held.offsets))
            rows = np.arange(batch.first_transfer, batch.first_transfer + len(held), dtype=np.uint64)
            self._spool.feed(pa.record_batch([held.flatten(), pa.array(np.repeat(rows, counts))], schema=_SCHEMA))

    def find(self, frames: Collection[int]) -> dict[int, int]:
        """Return the numbers of the transfers that hold these frames, by frame, both from 0; after the last batch."""
        wanted = np.fromiter(frames, np.uint64, len(frames))
        found: dict[int, int] = {}
        for held in self._spool.replay():
            at, of = (numbers(column) for column in held.columns)
            rows = np.flatnonzero(np.isin(at, wanted))
            found.update(zip(at[rows].tolist(), of[rows].tolist(), strict=True))
        return found

    def close(self) -> None:
        """Give the room back."""
        self._spool.close()
