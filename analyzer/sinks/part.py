"""A batch cut to a window: rows of every table that are wanted, with the numbers they have in the capture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from analyzer.cut import rows_inside
from analyzer.tables import numbers
from analyzer.window import Selection

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    import numpy.typing as npt

    from analyzer.engine import Batch

    Numbers = npt.NDArray[Any]


@dataclass(frozen=True, slots=True)
class Part:
    """The wanted rows of a batch, in capture order.

    `frame_rows` and `transfer_rows` are the numbers of their frames and transfers in the whole capture, from 0 (u64).
    """

    frames: pa.RecordBatch
    frame_rows: Numbers
    transfers: pa.RecordBatch
    transfer_rows: Numbers
    events: pa.RecordBatch
    messages: dict[str, pa.RecordBatch]
    settled: pa.RecordBatch
    buses: tuple[str, ...]


class PartSelection(Selection):
    """`Selection` for all tables: messages go with their transfers, frames and events as in `cut.FrameSelection`."""

    def parts(self, batches: Iterable[Batch]) -> Iterator[Part]:
        """What of the batches is inside the window."""
        for batch, rows, _ in self.apply(batches):
            frames, events = rows_inside(batch, self.window, self._limits())
            transfers = np.sort(rows)
            yield Part(
                frames=_taken(batch.frames, frames),
                frame_rows=frames.astype(np.uint64) + np.uint64(batch.first_frame),
                transfers=_taken(batch.transfers, transfers),
                transfer_rows=transfers.astype(np.uint64) + np.uint64(batch.first_transfer),
                events=_taken(batch.events, events),
                messages=dict(_messages(batch, transfers)),
                settled=batch.settled,
                buses=batch.buses,
            )


def _messages(batch: Batch, transfers: Numbers) -> Iterator[tuple[str, pa.RecordBatch]]:
    wanted = np.zeros(len(batch.transfers), bool)
    wanted[transfers] = True
    for name, table in batch.messages.items():
        of = (numbers(table.column("transfer")) - np.uint64(batch.first_transfer)).astype(np.int64)
        rows = np.flatnonzero(wanted[of])
        if rows.size:
            yield name, _taken(table, rows)


def _taken(table: pa.RecordBatch, rows: Numbers) -> pa.RecordBatch:
    return table if len(rows) == len(table) else table.take(pa.array(rows))
