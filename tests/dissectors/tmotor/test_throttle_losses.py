"""Losses of throttle in columns: the report before each."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dissectors.tmotor.rules.joined.throttle_losses import bases, spares

clock = st.lists(st.integers(0, 40), min_size=1, max_size=200)  # it may be set back


@given(clock, st.lists(st.tuples(st.integers(0, 199), st.integers(-1, 41)), min_size=1, max_size=8))
def test_the_last_report_up_to_the_last_throttle_goes_before_a_loss(
    t: list[int], losses: list[tuple[int, int]]
) -> None:
    begins = [(at % len(t), since) for at, since in losses]
    right = [max((k for k in range(at) if t[k] <= since), default=0) for at, since in begins]
    at, since = np.array(begins).T
    assert bases(np.array(t), at, since).tolist() == right


def test_reports_may_be_as_far_apart_as_there_are_times() -> None:
    most = (1 << 63) - 1
    assert spares(np.array([0, most, most]), np.array([0, 2])).tolist() == [0, 1 << 62]
    assert spares(np.array([most, 0, 0]), np.array([2])).tolist() == [-1 << 62]
