"""What is kept of the rows of a batch that is gone."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pytest

from analyzer.tables import FRAMES
from dissectors.kit import FrameTable


def batch(rows: int) -> pa.RecordBatch:
    """Frames of 0 to 8 bytes; the second one has no time."""
    columns = {
        "t": [None if k == 1 else k for k in range(rows)],
        "bus": [k % 3 for k in range(rows)],
        "id": range(rows),
        "flags": [k % 5 for k in range(rows)],
        "line": range(rows),
        "data": [bytes([k % 256]) * (k % 9) for k in range(rows)],
        "verdict": [k % 8 for k in range(rows)],
        "anomaly": [0] * rows,
    }
    return pa.RecordBatch.from_pydict({name: list(cells) for name, cells in columns.items()}, schema=FRAMES)


@pytest.mark.parametrize(("rows", "own"), [(3000, True), (1 << 15, False)])
def test_rows_that_are_kept_are_the_same(rows: int, own: bool) -> None:
    """Those of a small batch lie in memory of their own, without the columns that nobody asks for then."""
    frames = FrameTable(batch(rows + 5).slice(5), 7)
    kept = frames.bare
    assert frames.bare is kept
    assert (kept.first, len(kept)) == (7, rows)
    for name in ("t", "bus", "id", "flags", "verdict", "tail", "length"):
        assert np.array_equal(getattr(kept, name), getattr(frames, name))
    assert [kept.data(row) for row in range(20)] == [frames.data(row) for row in range(20)]
    assert np.shares_memory(kept.id, frames.id) != own
    with pytest.raises(AttributeError):
        kept.line  # noqa: B018


def test_a_time_that_is_missing_stays_missing() -> None:
    frames = FrameTable(batch(3))
    assert np.array_equal(frames.bare.t, frames.t)
    assert frames.bare.has("t").tolist() == [True, False, True]
