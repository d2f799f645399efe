"""Columns of all nodes at once say what each node's rows say alone."""

from __future__ import annotations

from array import array
from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dissectors.tmotor.rules.packets.agreement import _by_node, _outside, _Rows
from dissectors.tmotor.rules.packets.losses import _Losses

WINDOW, TOLERANCE = 5, [(0.1, 1.0), (0.0, 2.0), (0.5, 0.0)]
ROWS = st.lists(
    st.tuples(st.integers(0, 3), st.integers(0, 30), st.tuples(*[st.integers(-6, 6) | st.just(float("nan"))] * 3)),
    max_size=25,
)


def rows(told: list[Any]) -> _Rows:
    whole = [(node, t, number, 0) for number, (node, t, _) in enumerate(told)]
    values = [values for *_, values in told]
    return _Rows(np.array(whole, np.int64).reshape(-1, 4).T, np.array(values, np.float64).reshape(-1, 3).T)


def is_outside(packet: Any, status: list[Any]) -> bool:
    """Return whether a packet is outside of the range of the reports just before and just behind it."""
    node, t, values = packet
    mine = sorted((one for one in status if one[0] == node), key=lambda one: one[1])
    before = [one for one in mine if one[1] < t]
    after = [one for one in mine if one[1] >= t]
    if not before or not after or t - before[-1][1] > WINDOW or after[0][1] - t > WINDOW:
        return False
    for value, one, other, (share, floor) in zip(values, before[-1][2], after[0][2], TOLERANCE, strict=True):
        if not np.isnan([one, other]).any():
            least, most = min(one, other), max(one, other)
            if value < least - max(abs(least) * share, floor) or value > most + max(abs(most) * share, floor):
                return True
    return False


@given(ROWS, ROWS)
def test_packets_outside_of_the_reports_around_them(packets: list[Any], status: list[Any]) -> None:
    reports = rows(status)
    found = _outside(rows(packets), (_by_node(reports), reports.values), WINDOW, TOLERANCE)
    assert sorted(found.tolist()) == [k for k, one in enumerate(packets) if is_outside(one, status)]


@given(st.lists(st.lists(st.tuples(st.integers(0, 9), st.integers(-1, 3)), min_size=1, max_size=5), max_size=5))
def test_losses_come_in_order_whenever_they_come_out(batches: list[list[tuple[int, int]]]) -> None:
    losses = _Losses(array("q"), array("q"))
    batches = [sorted(told, key=lambda one: one[0]) for told in batches]
    for told in batches:
        losses.add(*zip(*told, strict=True))
    every = sorted((one for told in batches for one in told), key=lambda one: one[0])
    assert [*zip(losses.lead, losses.lost, strict=True)] == every
