"""Where frames that were picked from a capture stand in it."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from analyzer.decode.places import Places


@given(st.lists(st.lists(st.booleans(), max_size=40), max_size=8))
def test_places(parts: list[list[bool]]) -> None:
    """However the capture was cut."""
    places, first, expected = Places(), 0, list[int]()
    for part in parts:
        rows = np.flatnonzero(np.array(part, bool)).astype(np.uint32)
        places.add(first, rows)
        expected += [first + row for row in rows.tolist()]
        first += len(part)
    assert [places.of(frame) for frame in range(len(expected))] == expected
    assert [places.of(frame) for frame in (-1, len(expected))] == [-1, len(expected)]
