"""Rows of a batch that are shown: a batch of their own where they are few, so that nothing is done for all others."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from analyzer.window.first_frames import first_frames
from dissectors.kit.cells import numbers

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.decode.engine import Batch
    from analyzer.views.times import TimeFormat
    from dissectors.kit import Array

_FEW = 4  # one in so many rows, or fewer: more are read where they stand


class Pick:
    """Transfers of a batch that are shown, in the order of `rows`, all if not given.

    `batch` has them, at its rows `rows`; where they are few it has no others, and numbers them from 0. Its frames,
    events and settled verdicts are those of the whole batch.
    """

    def __init__(self, batch: Batch, rows: Array | None = None) -> None:
        self._whole = batch
        self._some = np.arange(len(batch.transfers)) if rows is None else np.asarray(rows, np.int64)
        self._cut = len(self._some) * _FEW <= len(batch.transfers)
        self.batch = self._own() if self._cut else batch
        self.rows = np.arange(len(self._some)) if self._cut else self._some

    def __len__(self) -> int:
        """Return how many transfers are shown."""
        return len(self.rows)

    def elapsed(self, clock: TimeFormat) -> pa.Array:
        """Return what a clock measures at each transfer of `batch`, in ns.

        One that follows all transfers has to be asked of each batch, if nothing of it is shown, too.
        """
        if not clock.follows_all:
            return clock.elapsed(self.batch.transfers.column("t"), self.rows)
        transfers = self._whole.transfers
        elapsed = clock.elapsed(transfers.column("t"), np.argsort(first_frames(transfers), kind="stable"))
        return elapsed.take(pa.array(self._some)) if self._cut else elapsed

    def _own(self) -> Batch:
        transfers = self._whole.transfers.take(pa.array(self._some))
        messages = _PickedTables(self._whole.messages, self._some, self._whole.first_transfer)
        return replace(self._whole, transfers=transfers, messages=messages, first_transfer=0)


class _PickedTables(Mapping[str, pa.RecordBatch]):
    """The tables of a batch, cut to what picked transfers carry when they are asked for.

    Their rows are in the order of the transfers; here they name the places of these among the picked ones.
    """

    def __init__(self, tables: Mapping[str, pa.RecordBatch], picked: Array, first: int) -> None:
        self._tables = tables
        self._owners = np.argsort(picked, kind="stable")
        self._transfers = picked[self._owners].astype(np.uint64) + np.uint64(first)
        self._made: dict[str, pa.RecordBatch] = {}

    def __getitem__(self, name: str) -> pa.RecordBatch:
        if name not in self._made:
            self._made[name] = self._cut(self._tables[name])
        return self._made[name]

    def _cut(self, table: pa.RecordBatch) -> pa.RecordBatch:
        owned = numbers(table.column("transfer"))
        start, stop = (np.searchsorted(owned, self._transfers, side) for side in ("left", "right"))
        count = stop - start
        rows = np.arange(count.sum()) + np.repeat(start - np.cumsum(count) + count, count)
        place = table.schema.get_field_index("transfer")
        owners = pa.array(np.repeat(self._owners, count).astype(np.uint64))
        return table.take(pa.array(rows)).set_column(place, table.schema.field(place), owners)

    def __iter__(self) -> Iterator[str]:
        return iter(self._tables)

    def __len__(self) -> int:
        return len(self._tables)
