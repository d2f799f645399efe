"""Steps of frame counts by what may share one."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dissectors.tmotor.rules.packets.count_steps import CountSteps

if TYPE_CHECKING:
    from collections.abc import Callable

    from dissectors.kit import Array

_KINDS = ("MotorStatus", "FocFeedback")
packets = st.lists(st.tuples(st.sampled_from(_KINDS), st.integers(1, 2), st.integers(0, 9)), max_size=8)


class _Table(SimpleNamespace):
    """As much of a table as is asked for; the core counts no steps in it."""

    columns: dict[str, Array]

    def __getitem__(self, name: str) -> Array:
        return self.columns[name]

    def has(self, name: str) -> Array:
        return np.full(len(self.trusted), "step" not in name)

    def once(self, make: Callable[[Any], Any]) -> Any:
        return make(self)


def _table(kind: str, rows: list[tuple[int, int, int]]) -> _Table:
    transfer, node, count = np.array(rows, np.int64).T
    none = np.zeros(len(rows), np.int64)
    columns = {"transfer": transfer, "offset": none, "frame_count": count, "unit_id": none, "count_step": none}
    columns["count_step_id"] = none
    return _Table(name=f"PUSHCAN.{kind}", columns=columns, sender=node.astype(np.uint16), trusted=none == 0)


@given(st.lists(packets, max_size=5))
def test_each_frame_id_is_counted_from_its_first_packet_on(batches: list[list[tuple[str, int, int]]]) -> None:
    steps, found, right, number = CountSteps(), [], [], 0
    last: dict[object, int] = {}
    for batch in batches:
        rows: dict[str, list[tuple[int, int, int]]] = {}
        for kind, node, count in batch:
            number += 1
            rows.setdefault(kind, []).append((number, node, count))
            both = [(count - last[key]) % 256 if key in last else None for key in (node, (kind, node))]
            last[node] = last[kind, node] = count
            if {*both} - {None, 1}:
                right.append((number << 16, (None, None, *both)))
        tables: Any = [_table(kind, some) for kind, some in sorted(rows.items())]
        found += [(hit.place, hit.steps) for hit in steps.feed(tables, {})]
    assert found == right
