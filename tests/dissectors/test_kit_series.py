"""What is remembered of nodes and keys keeps every number as it was: floats, NaN, and the ends of 64 bits."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.kit import NO_TIME, NODES, Latest, Previous

LOW, HIGH = NO_TIME, (1 << 63) - 1
NODE = np.array([7, 3, 7, 7], np.uint16)


def test_floats_are_not_cut() -> None:
    previous = Previous(0.5)
    (before,), row = previous.feed(NODE, np.array([1.25, -2.75, 3.5, 0.1]))
    assert before.tolist() == [0.5, 0.5, 1.25, 3.5]
    assert row.tolist() == [-1, -1, 0, 2]
    (before,), row = previous.feed(NODE, np.array([9.0, 8.0, 7.0, 6.0]))
    assert before.tolist() == [0.1, -2.75, 9.0, 7.0]
    assert row.tolist() == [-1, -1, 0, 2]


def test_a_start_that_is_whole_does_not_cut_floats() -> None:
    previous = Previous(0)
    (before,), _ = previous.feed(NODE, np.array([1.25, 2.5, 3.75, 4.5], np.float32))
    assert before.tolist() == [0, 0, 1.25, 3.75]
    (before,), _ = previous.feed(NODE[:1], np.array([1], np.int32))
    assert before.tolist() == [4.5]


def test_nan_and_infinity_stay() -> None:
    previous = Previous(math.nan)
    (before,), _ = previous.feed(NODE, np.array([math.inf, 1.0, math.nan, -math.inf]))
    assert math.isnan(before[0])
    assert before[2] == math.inf
    assert math.isnan(before[3])
    (before,), _ = previous.feed(NODE[:1], np.array([0.0]))
    assert before.tolist() == [-math.inf]


def test_whole_numbers_keep_all_their_bits_beside_floats() -> None:
    previous = Previous(LOW, 0.0)
    t = np.array([HIGH, LOW + 1, HIGH - 1, LOW], np.int64)
    (before, floats), _ = previous.feed(NODE, t, np.array([0.1, 0.2, 0.3, 0.4], np.float64))
    assert before.dtype == np.int64
    assert before.tolist() == [LOW, LOW, HIGH, HIGH - 1]
    assert floats.tolist() == [0.0, 0.0, 0.1, 0.3]
    (before, _), _ = previous.feed(NODE[:2], t[:2], np.zeros(2))
    assert before.tolist() == [LOW, LOW + 1]


def test_unsigned_numbers_of_64_bits() -> None:
    top = (1 << 64) - 1
    previous = Previous(0)
    (before,), _ = previous.feed(NODE, np.array([top, 1, top - 1, 1 << 63], np.uint64))
    assert before.tolist() == [0, 0, top, top - 1]
    with pytest.raises(ValueError, match="not negative"):
        Previous(-1).feed(NODE[:1], np.array([top], np.uint64))


def test_all_says_whether_every_node_has_it() -> None:
    previous = Previous(0)
    assert previous.all(0)
    previous.feed(NODE, np.array([0, 0, 5, 0]))
    assert previous.all(0)
    previous.feed(NODE, np.array([0, 5, 0, 0]))
    assert not previous.all(0)


def test_no_rows() -> None:
    (before,), row = Previous(1.5).feed(NODE[:0], np.empty(0))
    assert len(before) == len(row) == 0


ROWS = st.lists(st.tuples(st.sampled_from([0, 1, 200, NODES - 1]), st.integers(LOW, HIGH), st.floats()), max_size=30)


@given(ROWS, st.integers(0, 30))
def test_as_one_would_by_hand_however_it_is_cut(rows: list[tuple[int, int, float]], cut: int) -> None:
    previous, wanted, last = Previous(LOW, 0.0), [], {}
    for node, whole, real in rows:
        wanted.append(last.get(node, (LOW, 0.0)))
        last[node] = (whole, real)
    got = []
    for part in (rows[:cut], rows[cut:]):
        nodes = np.array([node for node, _, _ in part], np.uint16)
        whole = np.array([one for _, one, _ in part], np.int64)
        (one, two), _ = previous.feed(nodes, whole, np.array([one for _, _, one in part], np.float64))
        got += zip(one.tolist(), two.tolist(), strict=True)
    assert repr(got) == repr(wanted)  # NaN is not equal to itself


def test_the_latest_number_of_a_key() -> None:
    latest = Latest(0)
    keys = np.array([5, 70_000, 5], np.int64)
    latest.feed(keys, np.array([1, LOW, HIGH], np.int64))
    assert (latest.get(5), latest.get(70_000), latest.get(6), latest.get(1 << 20)) == (HIGH, LOW, 0, 0)
    with pytest.raises(TypeError, match="a float"):
        latest.feed(keys, np.array([0.5, 0.5, 0.5]))


def test_the_latest_float_of_a_key() -> None:
    latest = Latest(math.nan)
    latest.feed(np.array([5, 6]), np.array([0.1, math.inf]))
    assert (latest.get(5), latest.get(6)) == (0.1, math.inf)
    assert math.isnan(latest.get(7))
    assert math.isnan(latest.get(1 << 20))
