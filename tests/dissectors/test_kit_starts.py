"""Starts of nodes by uptimes that fall: those of a batch at once, as one by one."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import pyarrow as pa
import pytest

from dissectors.kit import SECOND, DecodedTable, Starts


class Batch:
    """A batch of NodeStatus by chance, as a rule sees it."""

    def __init__(self, chance: np.random.Generator, count: int) -> None:
        columns: dict[str, Any] = {
            "t": np.sort(chance.integers(0, 100, count)) * SECOND, "transfer": np.arange(count).astype(np.uint64),
            "bus": chance.integers(0, 2, count).astype(np.uint8), "src": chance.integers(1, 4, count).astype(np.uint8),
            "uptime_sec": chance.integers(0, 6, count).astype(np.uint32), "trusted": chance.random(count) < 0.8,
            "bits_left": np.zeros(count, np.int32),
        }  # fmt: skip
        self.status = DecodedTable("NodeStatus", pa.record_batch(columns), 0)

    def table(self, _name: str) -> DecodedTable:
        return self.status


@pytest.mark.parametrize("seed", range(20))
def test_where_an_uptime_is_lower_than_the_one_before_a_node_started(seed: int) -> None:
    chance = np.random.default_rng(seed)
    starts, last = Starts(), dict[tuple[int, int], int]()
    expected: list[tuple[int, int, int, int]] = []
    for count in (1, 9, 30):
        batch = Batch(chance, count)
        starts.feed(cast("Any", batch))
        status = batch.status
        rows = zip(
            *(column.tolist() for column in (status.t, status.bus, status.src, status["uptime_sec"])), strict=True
        )
        for (t, bus, node, uptime), good in zip(rows, status.trusted.tolist(), strict=True):
            if good:
                if uptime < last.get((bus, node), 0):
                    expected.append((bus, node, t - uptime * SECOND, t))
                last[bus, node] = uptime
    assert list(starts._known) == expected
