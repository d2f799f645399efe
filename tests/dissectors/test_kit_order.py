"""Rows in groups, and what changes from row to row, against the same row by row."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.kit import by_key, changes, count_below, groups, last_set
from dissectors.kit.order import spans, steps


@given(st.lists(st.integers(0, 3) | st.integers(0, 1 << 40)))
def test_groups_hold_each_place_once_and_in_order(keys: list[int]) -> None:
    found = [(key, places.tolist()) for key, places in groups(np.array(keys, np.int64))]
    assert found == [(key, [k for k, one in enumerate(keys) if one == key]) for key in sorted(set(keys))]


@given(st.lists(st.integers(0, 3) | st.integers(0, 1 << 40)))
def test_places_in_the_order_of_keys(keys: list[int]) -> None:
    order, first = by_key(np.array(keys, np.int64))
    expected = sorted(range(len(keys)), key=keys.__getitem__)
    assert order.tolist() == expected
    assert first.tolist() == [k for k, at in enumerate(expected) if k == 0 or keys[at] != keys[expected[k - 1]]]


@given(st.lists(st.tuples(st.integers(-2, 2), st.integers(1, 3))))
def test_spans_of_keys_that_stand_together(runs: list[tuple[int, int]]) -> None:
    keys = [key for key, count in runs for _ in range(count)]
    found = list(spans(np.array(keys, np.int64)))
    assert [key for key, begin, end in found for _ in range(begin, end)] == keys
    assert all(one[0] != after[0] and one[2] == after[1] for one, after in pairwise(found))


@pytest.mark.parametrize("kind", [np.uint8, np.int64, np.float64, bool])
@given(values=st.lists(st.integers(0, 1)), before=st.integers(0, 2))
def test_changes(kind: type, values: list[int], before: int) -> None:
    expected = [k for k, one in enumerate(values) if one != [before, *values][k]]
    assert changes(np.array(values, kind), before).tolist() == expected


@given(st.lists(st.integers(-9, 9)), st.integers(-9, 9))
def test_steps(values: list[int], before: int) -> None:
    expected = [one - [before, *values][k] for k, one in enumerate(values)]
    assert steps(np.array(values, np.int64), before).tolist() == expected


@given(st.lists(st.integers(0, 9)), st.lists(st.integers(0, 9)))
def test_counts_below(marks: list[int], numbers: list[int]) -> None:
    found = count_below(np.array(sorted(marks), np.int64), np.array(sorted(numbers), np.int64))
    assert found.tolist() == [sum(mark < number for mark in marks) for number in sorted(numbers)]


@given(st.lists(st.booleans()))
def test_latest(mask: list[bool]) -> None:
    expected = [max((k for k in range(end + 1) if mask[k]), default=-1) for end in range(len(mask))]
    assert last_set(np.array(mask, bool)).tolist() == expected
