"""The frames of the recent past: which are still there."""

from __future__ import annotations

import numpy as np
import pyarrow as pa

from analyzer.rules.recent import KEPT, Recent
from analyzer.tables import FRAMES
from dissectors.kit import FrameTable


def frames(first: int, rows: int) -> FrameTable:
    ones = {one.name: np.ones(rows, int) for one in FRAMES if one.name != "data"}
    return FrameTable(pa.RecordBatch.from_pydict(ones | {"data": [b"\x01"] * rows}, schema=FRAMES), first)


def are_there(recent: Recent, *numbers: int) -> list[bool]:
    known: list[bool] = recent.columns(np.array(numbers))[0].tolist()
    return known


def test_the_batch_before_the_newest_is_there_however_long_that_is() -> None:
    recent = Recent()
    for first, rows in ((0, 5), (5, 5), (10, KEPT)):
        recent.feed(frames(first, rows))
    assert are_there(recent, 4, 5, 9, 10) == [False, True, True, True]
    recent.feed(frames(10 + KEPT, 1))
    assert are_there(recent, 9, 10, 10 + KEPT) == [False, True, True]
