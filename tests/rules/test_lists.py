"""Lists of many rows in columns."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from analyzer.rules.transfers.lists import Lists, placed

LISTS = st.lists(st.lists(st.integers(0, 255), max_size=4), max_size=8)


def columns(lists: list[list[int]]) -> Lists:
    cells = np.array([one for some in lists for one in some], np.uint8)
    return Lists(np.cumsum([0, *map(len, lists)]), cells)


def plain(lists: Lists) -> list[list[int]]:
    return [lists.one(k) for k in range(len(lists.offsets) - 1)]


@given(LISTS, LISTS, st.data())
def test_lists_are_joined_and_taken(first: list[list[int]], second: list[list[int]], data: st.DataObject) -> None:
    joined = columns(first).joined(columns(second))
    assert plain(joined) == first + second
    rows = data.draw(st.lists(st.integers(0, len(first + second) - 1), max_size=9) if first + second else st.just([]))
    assert plain(joined.take(np.array(rows, np.int64))) == [(first + second)[row] for row in rows]
    assert plain(Lists.none(np.uint8).joined(columns(first))) == first


def test_places_begin_where_they_are_told() -> None:
    ends, places = placed(np.array([7, 2, 5], np.int32), np.array([2, 0, 3], np.int32))
    assert (ends.tolist(), places.tolist()) == ([0, 2, 2, 5], [7, 8, 5, 6, 7])
