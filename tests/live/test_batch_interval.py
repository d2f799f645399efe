"""How long a live session gathers rows: longer where judging takes long, never longer than somebody wants to wait."""

from __future__ import annotations

import itertools
from contextlib import ExitStack
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from analyzer.app.live.batch_interval import BatchInterval
from analyzer.app.live.session_recording import RecordingOptions, SessionPlan, SessionRecording
from analyzer.app.live.source import LiveSource


def intervals(busy: list[float], shortest: float = 0.4, longest: float = 1.0) -> list[float]:
    interval = BatchInterval(shortest, longest)
    found = [interval.seconds]
    for seconds in busy:
        interval.took(seconds)
        found.append(interval.seconds)
    return found


def test_quick_batches_come_as_often_as_somebody_wants_to_see_them() -> None:
    assert intervals([0.001, 0.01, 0.016]) == [0.4] * 4


def test_slow_batches_take_4_percent_of_the_time() -> None:
    assert intervals([0.03] * 9)[-1] == pytest.approx(0.72)


def test_the_interval_has_an_end() -> None:
    assert intervals([5.0] * 9)[-1] == 1.0


def test_one_slow_batch_makes_no_long_interval() -> None:
    assert intervals([5.0, 0.001]) == pytest.approx([0.4, 0.5, 0.4])


def test_at_once_stays_at_once() -> None:
    assert set(intervals([5.0] * 9, 0.1, 0.1)) == {0.1}


def test_a_batch_takes_no_longer_than_it_may_unless_it_is_the_shortest() -> None:
    """Half a second of judging for each second of the bus."""
    interval = BatchInterval(0.2, 4.0, 0.3)
    found = []
    for _ in range(40):
        interval.took(0.5 * interval.seconds)
        found.append(interval.seconds)
    assert max(found) <= 0.625
    assert found[-1] > 0.48
    interval.took(30.0)
    assert interval.seconds == 0.2


@given(busy=st.lists(st.floats(0, 1e6)))
def test_it_stays_between_its_bounds(busy: list[float]) -> None:
    assert all(0.2 <= seconds <= 0.5 for seconds in intervals(busy, 0.2, 0.5))


class Loop:
    """Has nothing to give, as often as it is asked."""

    def __init__(self, times: int) -> None:
        self.asked: list[float] = []
        self._times = times

    @property
    def ended(self) -> bool:
        return len(self.asked) >= self._times

    def take(self, seconds: float) -> list[Any]:
        self.asked.append(seconds)
        return []


def test_whoever_takes_the_rows_is_timed() -> None:
    loop, clock = Loop(9), itertools.count(0.0, 0.04)
    nothing = RecordingOptions(None, None, None, False, (), (), None, (), None, None)
    recording = SessionRecording(SessionPlan(nothing, (), ""), ExitStack())
    source = LiveSource(loop, recording, "", BatchInterval(0.4, 1.0), lambda: None, lambda: next(clock))  # type: ignore[arg-type]
    assert list(source.chunks()) == [b""] * 10
    assert loop.asked[:2] == [0.4, pytest.approx(0.5)]
    assert loop.asked[-1] == pytest.approx(24 * 0.04)
