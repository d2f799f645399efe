"""Losses of throttle in columns: where they are, the report before each, and how long is nothing."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dissectors.kit import Pauses
from dissectors.tmotor.rules.joined.hold import Hold, Sample
from dissectors.tmotor.rules.joined.throttle_losses import Losses, bases, spares

clock = st.lists(st.integers(0, 40), min_size=1, max_size=200)  # it may be set back
_BASE = Sample(0, 900, 10.0, 1.0)


@given(
    st.lists(clock, min_size=1, max_size=3),
    st.lists(st.tuples(st.integers(0, 2), st.integers(0, 199), st.integers(-1, 41)), min_size=1, max_size=8),
)
def test_the_last_report_up_to_the_last_throttle_goes_before_a_loss(
    each: list[list[int]], losses: list[tuple[int, int, int]]
) -> None:
    starts = [sum(map(len, each[:k])) for k in range(len(each))]
    t = [one for part in each for one in part]
    begins = [(starts[esc % len(each)], at % len(each[esc % len(each)]), since) for esc, at, since in losses]
    right = [max((k for k in range(start, start + at) if t[k] <= since), default=start) for start, at, since in begins]
    start, at, since = np.array(begins).T
    assert bases(np.array(t), start + at, since, start).tolist() == right


def test_reports_may_be_as_far_apart_as_there_are_times() -> None:
    most = (1 << 63) - 1
    assert spares(np.array([0, most, most]), np.array([0, 2]), np.zeros(2, int)).tolist() == [0, 1 << 62]
    assert spares(np.array([most, 0, 0]), np.array([2]), np.zeros(1, int)).tolist() == [-1 << 62]
    assert spares(np.array([5, 9, most, 0, 0]), np.array([4]), np.array([2])).tolist() == [-1 << 62]


def test_each_esc_has_its_own_losses() -> None:
    t = np.array([0, 10, 20, 5, 15, 25, 35])
    lost, since = np.array([False, True, True, True, True]), np.array([7, 7, 7, 1, 1])
    holds = [None, Hold(1, _BASE, 3)]
    ends, starts = np.array([0, 2, 5]), np.array([0, 3, 7])
    losses = Losses(Pauses(1000), 10, np.zeros(2, int), ends, t, starts, lost, since, holds)
    some = losses.stretches
    assert (some.first.tolist(), some.stop.tolist(), some.since.tolist()) == ([1, 2, 3], [2, 3, 5], [7, 7, 1])
    assert (losses.esc.tolist(), losses.ends, losses.holding.tolist()) == ([0, 1, 1], [0, 1, 3], [False, False, False])
    assert some.base.tolist() == [0, 3, 3]
    assert some.heard.tolist() == [True, False, True]
    assert losses.of(np.array([1, 4]))[0].tolist() == [0, 2]


def test_a_loss_that_goes_on_keeps_what_is_usual() -> None:
    t = np.array([0, 10, 20, 30])
    lost, since = np.ones(4, bool), np.full(4, -5)
    both = [Losses(Pauses(1000), 10, np.zeros(1, int), np.array([0, 4]), t, np.array([0, 4]), lost, since, [hold])
            for hold in (Hold(-5, _BASE, 77), Hold(-6, _BASE, 77))]  # fmt: skip
    assert [(one.holding.tolist(), one.stretches.spare.tolist()) for one in both] == [([True], [77]), ([False], [0])]
