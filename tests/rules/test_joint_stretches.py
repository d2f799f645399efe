"""Stretches in which senders lack frames: the core counts who lacks some at once as a plain count of them does."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analyzer._native import joint
from analyzer.decode.sent import cells
from analyzer.rules.joint.losses import _together

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

APART, NEARBY = 3, 5


class Stretch(NamedTuple):
    """Times and places between which frames of a node are missing."""

    since: int
    until: int
    first: int
    last: int
    window: int
    node: int


@st.composite
def stretches(draw: st.DrawFn) -> Stretch:
    since, first = draw(st.integers(0, 60)), draw(st.integers(0, 60))
    long, far = draw(st.integers(-3, 25)), draw(st.integers(1, 9))
    return Stretch(since, since + long, first, first + far, draw(st.integers(1, 12)), draw(st.integers(1, 4)))


def nodes(some: Iterable[Stretch]) -> int:
    return len({one.node for one in some})


def close(one: Stretch, every: Sequence[Stretch]) -> int:
    """Of how many senders narrow ones end within its window, in the row of narrow ones without a pause."""
    row: list[Stretch] = []
    behind = -APART - 1
    for each in sorted((each for each in every if each.until - each.since <= each.window), key=lambda s: s[2:4]):
        if each.first - behind > APART:
            if one in row:
                break
            row = []
        behind = max(behind, each.last) if row else each.last
        row.append(each)
    return nodes(each for each in row if abs(each.until - one.until) <= one.window) if one in row else 0


def met(one: Stretch, every: Sequence[Stretch]) -> int:
    """Of how many senders, at most, stretches meet at one time in it."""
    wide = [(each, each.since - NEARBY, each.until + NEARBY) for each in every]
    times = range(one.since - NEARBY, one.until + NEARBY + 1)
    return max(nodes(each for each, begin, end in wide if begin <= t <= end) for t in times)


@given(st.lists(stretches(), max_size=12, unique=True), st.integers(1, 12))
def test_senders_are_counted_as_one_by_one(every: list[Stretch], window: int) -> None:
    every = [one._replace(window=window) for one in every]
    *columns, node = np.array(every, np.int64).reshape(-1, 6).T.copy()
    of, senders, since, until = (
        cells(column, np.int64).tolist() for column in joint((*columns, node.astype(np.uint8)), APART, NEARBY)
    )
    assert sorted(of) == list(range(len(every)))
    for k, count, begin, end in zip(of, senders, since, until, strict=True):
        one = every[k]
        assert count == max(close(one, every), met(one, every))
        assert min(one.since, one.until) <= min(begin, end) <= max(begin, end) <= max(one.since, one.until)


def test_columns_that_do_not_fit_are_refused() -> None:
    one, two, node = np.zeros(1, np.int64), np.zeros(2, np.int64), np.zeros(1, np.uint8)
    with pytest.raises(ValueError, match="do not fit together"):
        joint((one, two, one, one, one, node), APART, NEARBY)


@pytest.mark.parametrize("rows", [[], [0], [4, 5, 6], [4, 6, 7], [0, 2]])
def test_rows_that_follow_each_other_are_a_slice(rows: list[int]) -> None:
    found = _together(np.array(rows, np.int64))
    assert np.arange(9)[found].tolist() == rows
    assert isinstance(found, slice) == (rows in ([0], [4, 5, 6]))
