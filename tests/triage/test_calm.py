"""What is quick while nothing changes: the same as what is found row by row, however rows come in pieces."""

from __future__ import annotations

import warnings
from itertools import pairwise
from math import isnan

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from analyzer.flight.clock import RowPlaces, Spot
from analyzer.flight.robust import of_few
from analyzer.flight.silences import _paces
from analyzer.flight.spells import Spells

ROWS = st.lists(st.tuples(st.booleans() | st.just(value=True), st.integers(0, 4)), min_size=1)
NUMBERS = st.integers(-5, 5) | st.floats(allow_nan=True, allow_infinity=True, width=32)


def _places(ran: list[int]) -> RowPlaces:
    times = np.array(ran, np.int64)
    frames = np.arange(len(times))
    return RowPlaces(times, times, frames, frames, np.ones(len(times), np.int64))


def _told(on: list[bool], ran: list[int], cut: int, patience: int, least: int = 0) -> list[tuple[object, ...]]:
    spells = Spells(patience, least)
    parts = [
        part
        for rows in (slice(0, cut), slice(cut, None))
        for part in spells.feed("key", np.array(on[rows], bool), _places(ran).take(rows))
    ]
    over = [part.spell for part in parts if part.over]
    found = [(one.before, one.first, one.last, one.after, one.silent) for one in over]
    return [*found, *((one.before, one.first, one.last) for one in spells.finish())]


def _lasts(told: tuple[object, ...]) -> int:
    _, first, last, *_ = told
    assert isinstance(first, Spot)
    assert isinstance(last, Spot)
    return last.ran - first.ran


@given(ROWS, st.data())
def test_spells_are_the_same_in_two_pieces(rows: list[tuple[bool, int]], data: st.DataObject) -> None:
    on, ran = [one for one, _ in rows], np.cumsum([step for _, step in rows]).tolist()
    cut, patience = data.draw(st.integers(0, len(rows))), data.draw(st.integers(0, 3))
    assert _told(on, ran, cut, patience) == _told(on, ran, len(rows), patience)


@given(ROWS, st.data())
def test_only_short_spells_are_left_out(rows: list[tuple[bool, int]], data: st.DataObject) -> None:
    on, ran = [one for one, _ in rows], np.cumsum([step for _, step in rows]).tolist()
    cut, patience = data.draw(st.integers(0, len(rows))), data.draw(st.integers(0, 3))
    every, some = (_told(on, ran, cut, patience, least) for least in (0, 4))
    assert set(some) <= set(every)
    assert [one for one in some if _lasts(one) >= 4] == [one for one in every if _lasts(one) >= 4]


@given(st.lists(st.integers(-9, 9), min_size=1))
def test_the_pace_and_spots_of_places(ran: list[int]) -> None:
    places = _places(ran)
    apart = [b - a for a, b in pairwise(ran)] or [0]
    assert places.pace == (min(apart), max(apart))
    for row in (0, -1, len(ran) // 2):
        assert places.at(row).ran == places.at(row).t == ran[row]


@given(st.lists(st.lists(st.integers(-9, 9), min_size=1), min_size=1))
def test_paces_of_groups(groups: list[list[int]]) -> None:
    begins = np.cumsum([0, *map(len, groups)])[:-1]
    apart = [[b - a for a, b in pairwise(one)] or [0] for one in groups]
    found = list(_paces(np.array([ran for one in groups for ran in one], np.int64), begins))
    assert found == [(min(one), max(one)) for one in apart]


@given(st.lists(NUMBERS, max_size=9))
def test_the_median_of_a_few(values: list[float]) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        expected = float(np.median(values))
    found = of_few(values)
    assert found == expected or (isnan(found) and isnan(expected))
