"""A few rows of a stored batch as a batch of their own: what views write without looking at all the others."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from analyzer.decode.engine import Batch
from analyzer.tables import FRAMES, SETTLED, TRANSFERS, empty
from analyzer.views.frames.window import FrameWindow, RawFrame
from dissectors.kit.cells import numbers

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.browser.store.store import TableStore
    from dissectors.kit import Array

_RAW = ("id", "flags", "data")


class StoredFrames(FrameWindow):
    """Frames of a store, by their number from 0."""

    def __init__(self, store: TableStore) -> None:
        super().__init__()
        self._store = store

    def rows(self, places: Array) -> dict[str, pa.Array]:
        """Return the columns `id`, `flags` and `data` of frames, null for those that are not there."""
        at = np.array([-1 if (one := self._store.segment_of(int(p))) is None else one for p in places], np.int64)
        parts, order = [], []
        for segment in np.unique(at[at >= 0]).tolist():
            inside = np.flatnonzero(at == segment)
            table = self._store.opened(segment).table("frames")
            index = places[inside] - self._store.segments[segment].first_frame
            parts.append(table.select(_RAW).take(pa.array(index.astype(np.int64))))
            order.append(inside)
        parts = parts or [empty(FRAMES).select(_RAW)]
        where = np.full(len(places), -1, np.int64)
        for k, place in enumerate(np.concatenate(order).tolist() if order else []):
            where[place] = k
        rows = pa.array(where, mask=where < 0)
        return {name: pa.concat_arrays([part.column(name) for part in parts]).take(rows) for name in _RAW}

    def __call__(self, number: int) -> RawFrame | None:
        """Return the frame with this number."""
        at = self._store.segment_of(number)
        if at is None:
            return None
        table, row = self._store.opened(at).table("frames"), number - self._store.segments[at].first_frame
        t = table.column("t")[row]
        told = int(t.value) if t.is_valid else None
        frame_id, data, bus, flags = (table.column(name)[row].as_py() for name in ("id", "data", "bus", "flags"))
        return RawFrame(frame_id, data, bus, told, flags)


def cut_transfers(store: TableStore, numbered: Sequence[int]) -> Batch:
    """Return a batch with transfers of any segments, by their numbers from 0 in ascending order, numbered from 0."""
    parts: list[pa.RecordBatch] = []
    messages: dict[str, list[pa.RecordBatch]] = {}
    wanted = np.asarray(numbered, np.int64)
    readings, count = store.segments[-1].readings if store.segments else (), 0
    of = [store.segment_of_transfer(number) for number in numbered]
    for at in sorted({one for one in of if one is not None}):
        opened = store.opened(at)
        first = store.segments[at].first_transfer
        some = wanted[[one == at for one in of]]
        parts.append(opened.table("transfers").take(pa.array(some - first)))
        readings = store.segments[at].readings
        for name, table in opened.batch.messages.items():
            transfer = numbers(table.column("transfer"))
            low, high = (np.searchsorted(transfer, some.astype(np.uint64), side) for side in ("left", "right"))
            sizes = high - low
            if sizes.any():
                rows = np.concatenate([np.arange(a, b) for a, b in zip(low, high, strict=True)])
                index = np.repeat(np.arange(len(some)), sizes).astype(np.uint64) + np.uint64(count)
                found = table.take(pa.array(rows))
                place = found.schema.get_field_index("transfer")
                messages.setdefault(name, []).append(
                    found.set_column(place, found.schema.field(place), pa.array(index))
                )
        count += len(some)
    return Batch(
        frames=empty(FRAMES), transfers=_joined(parts) if parts else empty(TRANSFERS),
        events=store.opened(0).table("events").slice(0, 0), messages={n: _joined(p) for n, p in messages.items()},
        settled=empty(SETTLED), first_frame=0, first_transfer=0, buses=store.buses, readings=readings,
    )  # fmt: skip


def _joined(parts: list[pa.RecordBatch]) -> pa.RecordBatch:
    return parts[0] if len(parts) == 1 else pa.concat_batches(parts)
