"""A batch cut to a window: rows of every table that are wanted, with the numbers they have in the capture."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from analyzer.window.cut import rows_inside
from analyzer.window.selection import TransferSelection
from dissectors.kit.cells import numbers

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from analyzer.decode.engine import Batch
    from dissectors.kit import Array


@dataclass(frozen=True, slots=True)
class BatchPart:
    """The wanted rows of a batch, in capture order.

    `frame_rows` and `transfer_rows` are the numbers of their frames and transfers in the whole capture, from 0 (u64).
    `settled` and `settled_before` are those of the whole batch.
    """

    frames: pa.RecordBatch
    frame_rows: Array
    transfers: pa.RecordBatch
    transfer_rows: Array
    events: pa.RecordBatch
    messages: Mapping[str, pa.RecordBatch]
    settled: pa.RecordBatch
    buses: tuple[str, ...]
    settled_before: int


class TableSelection(TransferSelection):
    """A window over all tables: messages go with their transfers, frames and events as in `cut.FrameSelection`."""

    def parts(self, batches: Iterable[Batch]) -> Iterator[BatchPart]:
        """Yield the batches, cut to the window."""
        for batch, rows, _ in self.apply(batches):
            frames, events = rows_inside(batch, self.window, self._limits(), self.numbering)
            transfers = np.sort(rows)
            if batch.selected is not None:
                transfers = transfers[batch.selected.transfers[transfers]]
                frames, events = frames[batch.selected.frames[frames]], events[batch.selected.events[events]]
            yield BatchPart(
                frames=_take_rows(batch.frames, frames),
                frame_rows=frames.astype(np.uint64) + np.uint64(batch.first_frame),
                transfers=_take_rows(batch.transfers, transfers),
                transfer_rows=transfers.astype(np.uint64) + np.uint64(batch.first_transfer),
                events=_take_rows(batch.events, events),
                messages=dict(_messages(batch, transfers)),
                settled=batch.settled,
                buses=batch.buses,
                settled_before=batch.settled_before,
            )

    def _pick(self, batch: Batch) -> tuple[Batch, Array, int | None]:
        if self.window or batch.selected is not None:
            return super()._pick(batch)
        return batch, np.arange(len(batch.transfers)), self._zero()


def narrowed(batch: Batch) -> Batch:
    """Return a batch with only the rows that are marked; they keep the numbers that they have in the capture."""
    selected = batch.selected
    if selected is None:
        return batch
    transfers, frames, events, settled = (
        np.flatnonzero(mask) for mask in (selected.transfers, selected.frames, selected.events, selected.settled)
    )
    return replace(
        batch,
        frames=_take_rows(batch.frames, frames),
        transfers=_take_rows(batch.transfers, transfers),
        events=_take_rows(batch.events, events),
        settled=_take_rows(batch.settled, settled),
        messages=dict(_messages(batch, transfers)),
        bit_times=None,
        selected=None,
    )


def _messages(batch: Batch, transfers: Array) -> Iterator[tuple[str, pa.RecordBatch]]:
    if len(transfers) == len(batch.transfers):
        yield from batch.messages.items()
        return
    wanted = np.zeros(len(batch.transfers), bool)
    wanted[transfers] = True
    for name, table in batch.messages.items():
        of = (numbers(table.column("transfer")) - np.uint64(batch.first_transfer)).astype(np.int64)
        rows = np.flatnonzero(wanted[of])
        if rows.size:
            yield name, _take_rows(table, rows)


def _take_rows(table: pa.RecordBatch, rows: Array) -> pa.RecordBatch:
    return table if len(rows) == len(table) else table.take(pa.array(rows))
