"""Silences of a bus: how much of some time they take."""

from __future__ import annotations

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dissectors.kit import Pauses

_LEAST = 5
times = st.integers(0, 3000)
question = st.tuples(st.integers(1, 200), times, times, st.integers(-9, 60))


def _known(t: list[int]) -> Pauses:
    pauses = Pauses(_LEAST)
    frames = _Frames(bus=np.zeros(len(t), np.uint8), t=np.array(t))
    pauses.feed(SimpleNamespace(frames=frames))  # type: ignore[arg-type]  # all that it looks at
    return pauses


class _Frames(SimpleNamespace):
    __hash__ = object.__hash__


@given(st.lists(st.integers(-20, 60), min_size=1, max_size=300), st.lists(question, min_size=1, max_size=9))
def test_many_questions_are_answered_at_once(steps: list[int], asked: list[tuple[int, int, int, int]]) -> None:
    t = np.cumsum(steps).tolist()
    silences = [(one, after) for one, after in pairwise(t) if after - one > _LEAST]
    right = [
        sum(max(min(end, stop) - max(begin, start) - spare, 0) for begin, end in silences) >= least
        for least, start, stop, spare in asked
    ]
    least, start, stop, spare = np.array(asked).T
    assert _known(t).last_for(least, 0, start, stop, spare).tolist() == right


def test_no_silence_lasts_for_nothing() -> None:
    none = np.empty(0, np.int64)
    assert _known([0, 1]).last_for(none, 0, none, none, none).tolist() == []
    one = np.ones(1, np.int64)
    assert _known([0, 1]).last_for(one, 0, 0 * one, 9 * one, 0 * one).tolist() == [False]
    assert _known([0, 9]).last_for(one, 1, 0 * one, 9 * one, 0 * one).tolist() == [False]
