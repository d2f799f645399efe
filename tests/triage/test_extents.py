"""Extents of ESCs: quick where nothing is new, the same as row by row."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from analyzer.flight.supply.extents import EscExtent

IDLE = 100.0
SPEEDS = st.sampled_from([0.0, 99.0, 100.0, 101.0, 900.0, -99.0, -101.0, -900.0, np.nan])


def _ways(pieces: list[list[float]], *, quick: bool) -> list[tuple[int, bool]]:
    one, ran = EscExtent("table", 0, 1, 1, 0, 0), 0
    for rpm in pieces:
        values = np.array(rpm)
        low, high = float(np.fmin.reduce(values)), float(np.fmax.reduce(values))
        if not quick or not one.goes_on(low, high, IDLE):
            one.turn(values, np.arange(ran, ran + len(rpm)), IDLE)
        ran += len(rpm)
    return one.ways


@given(st.lists(st.lists(SPEEDS, min_size=1, max_size=4)))
def test_ways_are_those_of_all_rows(pieces: list[list[float]]) -> None:
    assert _ways(pieces, quick=True) == _ways(pieces, quick=False)
