"""Fewer points, but every peak: laws of the lowest and the highest of each bucket."""

from __future__ import annotations

from itertools import pairwise
from math import inf, nan

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from kit.pictures import draw
from kit.simulated import flown

from analyzer.plot.moments import Moments
from analyzer.plot.thinning import Thinned

NUMBERS = st.lists(st.floats(allow_nan=True, allow_infinity=True, width=32), max_size=300)


def thin(values: list[float], most: int, cuts: list[int]) -> tuple[Thinned, list[int], list[float]]:
    one = Thinned(most)
    array = np.array(values, np.float64)
    places = np.arange(len(values), dtype=np.int64)
    ends = sorted({min(cut, len(values)) for cut in cuts} | {0, len(values)})
    for start, end in pairwise(ends):
        one.feed(Moments(places[start:end] * 10, places[start:end] + 1), array[start:end])
    moments, points = one.points()
    assert (moments.t // 10 == moments.frame - 1).all()
    return one, (moments.frame - 1).tolist(), points.tolist()


@given(NUMBERS, st.integers(4, 60), st.lists(st.integers(0, 300), max_size=8))
@example([nan, inf] * 9, 4, [])
@example([nan, -inf, 1.0, nan] * 9, 4, [5])
def test_peaks_stay_and_the_limit_holds(values: list[float], most: int, cuts: list[int]) -> None:
    one, places, points = thin(values, most, cuts)
    assert len(places) <= most
    assert places == sorted(set(places))
    assert np.array_equal(points, [values[k] for k in places], equal_nan=True)
    if len(values) <= most:
        assert places == list(range(len(values)))
        assert one.bucket == 1
        return
    for start in range(0, len(values), one.bucket):
        bucket = [v for v in values[start : start + one.bucket] if not np.isnan(v)]
        kept = [values[k] for k in places if start <= k < start + one.bucket]
        assert 1 <= len(kept) <= 2
        if bucket:
            assert min(kept) == min(bucket)
            assert max(kept) == max(bucket)


@given(NUMBERS, st.integers(4, 60), st.lists(st.integers(0, 300), max_size=8))
def test_how_points_come_does_not_matter(values: list[float], most: int, cuts: list[int]) -> None:
    _, once, points = thin(values, most, [])
    _, again, others = thin(values, most, cuts)
    assert once == again
    assert np.array_equal(points, others, equal_nan=True)


@given(st.integers(1, 50_000), st.integers(4, 500))
def test_memory_is_bounded_and_no_point_is_wasted(count: int, most: int) -> None:
    one = Thinned(most)
    steps = np.arange(count, dtype=np.int64)
    for start in range(0, count, 1000):
        one.feed(Moments(steps[start : start + 1000], steps[start : start + 1000]), np.sin(steps[start : start + 1000]))
        assert one._held <= 2 * most + 1000
    moments, _ = one.points()
    assert min(count, most // 4) <= len(moments) <= most


@pytest.mark.slow
def test_a_picture_with_fewer_points_keeps_extremes_and_says_so() -> None:
    text = flown(20, escs=2, flight="mission").text
    whole, _ = draw(text)
    thinned, picture = draw(text, most=50)
    cut, _ = draw(text, most=50, size=5000)
    lost = picture.thinned()
    for path in whole.rows:
        if not path.startswith(("/states", "/messages", "/frame_rate/limit")):
            values, few = whole.values(path), thinned.values(path)
            assert len(few) <= 50
            assert (min(few), max(few)) == (min(values), max(values))
            assert thinned.points(path) == cut.points(path)
            assert (path in lost) == (len(values) > 50)
            assert path not in lost or lost[path].count == len(values)
    assert whole.rows["/states/mode/esc1"] == thinned.rows["/states/mode/esc1"]
