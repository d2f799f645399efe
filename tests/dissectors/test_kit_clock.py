"""The times of a batch's frames by bus."""

from __future__ import annotations

from itertools import pairwise

import pyarrow as pa
from hypothesis import given
from hypothesis import strategies as st

from analyzer.tables import FRAMES
from dissectors.kit import FrameTable, times_by_bus


@given(st.lists(st.tuples(st.integers(0, 9) | st.none(), st.integers(0, 1))))
def test_times_of_each_bus(rows: list[tuple[int | None, int]]) -> None:
    columns = {
        field.name: pa.array([b"" if field.name == "data" else 0] * len(rows), field.type) for field in FRAMES
    } | {"t": pa.array([t for t, _ in rows], FRAMES.field("t").type), "bus": pa.array([b for _, b in rows], pa.uint8())}
    frames = FrameTable(pa.RecordBatch.from_pydict(columns, schema=FRAMES))
    found = {one.bus: one for one in times_by_bus(frames)}
    assert times_by_bus(frames) is times_by_bus(frames)
    for bus in (0, 1):
        own = [(k, t) for k, (t, on) in enumerate(rows) if on == bus and t is not None]
        assert (bus in found) == bool(own)
        if own:
            one, t = found[bus], [t for _, t in own]
            apart = [b - a for a, b in pairwise(t)]
            assert one.t.tolist() == t
            assert (list(range(len(rows))) if one.rows is None else one.rows.tolist()) == [k for k, _ in own]
            assert one.longest == max([0, *apart])
            assert one.back == -min([0, *apart])
            assert one.steady == (one.back == 0)
