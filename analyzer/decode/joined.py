"""Batches that follow each other as one: a bus is shown more often than it is judged."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from analyzer.decode.tables import LazyTables
from analyzer.decode.verdicts import with_verdicts
from dissectors.kit.cells import numbers

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from analyzer.decode.engine import Batch


def joined(parts: Sequence[Batch]) -> Batch:
    """Return batches of one engine that follow each other as the one that it would have given in their place.

    Only the order of message tables is another one. None of the batches has rows `selected`, or `places`.
    """
    first, last = parts[0], parts[-1]
    if len(parts) == 1:
        return first
    frames, settled = (pa.concat_batches([getattr(one, name) for one in parts]) for name in ("frames", "settled"))
    number = numbers(settled.column("frame")).astype(np.int64)
    inside = number >= first.first_frame
    if inside.any():
        verdict, anomaly = (numbers(settled.column(name))[inside] for name in ("verdict", "anomaly"))
        frames = with_verdicts(frames, number[inside] - first.first_frame, verdict, anomaly)
        settled = settled.filter(pa.array(~inside))
    tables = [one.messages for one in parts]
    names = dict.fromkeys(name for one in tables for name in one)
    bits = [one.bit_times for one in parts if one.bit_times is not None]
    return replace(
        last, frames=frames, settled=settled,
        transfers=pa.concat_batches([one.transfers for one in parts]),
        events=pa.concat_batches([one.events for one in parts]),
        messages=LazyTables({name: partial(_table, tables, name) for name in names}),
        first_frame=first.first_frame, first_transfer=first.first_transfer,
        bit_times=np.concatenate(bits) if len(bits) == len(parts) else None,
    )  # fmt: skip


def _table(tables: Sequence[Mapping[str, pa.RecordBatch]], name: str) -> pa.RecordBatch:
    return pa.concat_batches([one[name] for one in tables if name in one])
