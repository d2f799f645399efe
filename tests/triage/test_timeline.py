"""Time lines: what is kept of a capture to be drawn, on which axis, and in whose lane."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from kit import CAPTURES
from kit.strategies import examples
from kit.triaged import flown, of

from analyzer.app.request import Request
from analyzer.app.run import Run
from analyzer.app.triage import RunTriage
from analyzer.flight.clock import Spot
from analyzer.flight.log import FlightEvent
from analyzer.flight.timeline.axis import TimelineAxis
from analyzer.flight.timeline.course import MOST_STEPS, DeviceValues
from analyzer.flight.timeline.timeline import LONGEST
from dissectors.times import MILLISECOND, SECOND

if TYPE_CHECKING:
    from analyzer.flight.timeline.timeline import TimeLine

START = 1_773_475_330 * SECOND


# ---- courses


@examples(60)
@example(points=[(25, 0.0), (0, 0.0), (6400, 0.0)], cuts=[1])  # what comes late is before the first
@given(
    st.lists(st.tuples(st.integers(0, 120_000), st.floats(-1e4, 1e4, width=32)), min_size=1, max_size=300),
    st.lists(st.integers(0, 300), max_size=4),
)
def test_a_course_keeps_the_lowest_and_the_highest_however_it_is_fed(
    points: list[tuple[int, float]], cuts: list[int]
) -> None:
    ran = START + np.array([t for t, _ in points], np.int64) * MILLISECOND
    values = np.array([[value for _, value in points]], np.float32)
    course = DeviceValues(1)
    borders = sorted({0, len(points), *(cut for cut in cuts if cut < len(points))})
    for low, high in itertools.pairwise(borders):
        course.feed(ran[low:high], values[:, low:high])
    cut = course.cut(START, START + 121 * SECOND)
    assert cut.step == 25 * MILLISECOND
    steps = ran // cut.step
    assert cut.start.tolist() == sorted(set((steps * cut.step).tolist()))
    for at, low, high in zip(cut.start, cut.low[0], cut.high[0], strict=True):
        there = values[0][steps * cut.step == at]
        assert (low, high) == (there.min(), there.max())


def test_what_is_old_is_kept_in_coarser_steps_and_memory_is_bounded() -> None:
    course, second = DeviceValues(2), 50
    values = np.vstack((np.sin(np.arange(600 * second)), np.full(600 * second, np.nan))).astype(np.float32)
    for minute in range(0, 7200, 600):
        ran = START + (minute * second + np.arange(600 * second)) * (SECOND // second)
        course.feed(ran, values)
    new, old = (course.cut(START + at * SECOND, START + (at + 60) * SECOND) for at in (7140, 1800))
    assert (new.step, old.step) == (25 * MILLISECOND, 1600 * MILLISECOND)
    assert len(new.start) == 2400
    assert 37 <= len(old.start) <= 39
    assert old.low[0].max() < -0.9
    assert old.high[0].min() > 0.9
    assert np.isnan(new.low[1]).all()
    assert all(level._low.shape == (2, MOST_STEPS) for level in course._levels[:2])


def test_a_course_grows_by_channels() -> None:
    course = DeviceValues(1)
    course.feed(np.array([START]), np.array([[1.0]], np.float32))
    course.widen(2)
    course.feed(np.array([START + SECOND]), np.array([[2.0], [3.0]], np.float32))
    cut = course.cut(START, START + 2 * SECOND)
    assert np.array_equal(cut.low, [[1, 2], [np.nan, 3]], equal_nan=True)


# ---- the axis


def hole(kind: str, t: int, length: int, ran: int, frame: int) -> FlightEvent:
    return FlightEvent(kind, kind, Spot(t, ran, frame, frame, 0), Spot(t + length, ran, frame, frame, 0))


def test_holes_are_on_the_axis_and_steps_of_the_clock_are_not() -> None:
    ran = START + 10 * SECOND
    gap = hole("gap", ran, 2 * SECOND, ran, 100)
    step = hole("clock", ran + 7 * SECOND, 3600 * SECOND, ran + 5 * SECOND, 200)
    behind = Spot(START + 3632 * SECOND, START + 30 * SECOND, 300, 300, 0)
    axis = TimelineAxis([gap, step], behind)
    assert axis.at(behind.ran) == behind.t
    assert axis.at(ran + SECOND) - axis.at(ran - SECOND) == 4 * SECOND  # the hole, and a second before and behind it
    assert axis.at(ran + 6 * SECOND) - axis.at(ran + 4 * SECOND) == 2 * SECOND
    for second in range(40):
        at = START + second * SECOND
        assert axis.ran(axis.at(at)) == at
    (first, other) = axis.breaks
    assert first.end - first.start == 2 * SECOND
    assert other.end == other.start
    assert axis.ran(first.start + SECOND) == ran  # inside of it


# ---- lanes


def lane(line: TimeLine, kind: str, ch: int | None = None) -> Any:
    (found,) = [one for one in line.lanes if one.kind == kind and one.ch == ch]
    return found


def test_a_lane_a_channel_with_what_it_did() -> None:
    found = of("propeller-lost.log")
    minute = found.timelines[0]
    verdict = found.first
    assert minute.onset == (verdict.t, verdict.t_end)
    assert [(one.kind, one.ch) for one in minute.lanes] == [
        ("commands", None), ("supply", None), *(("device", ch) for ch in (1, 2, 3, 4)), ("node", None),
    ]  # fmt: skip
    odd = lane(minute, "device", 4)
    assert set(odd.strands) == {"speed", "current", "temperature", "commanded"}
    speed, current = odd.strands["speed"], odd.strands["current"]
    behind = speed.t > verdict.t_end + SECOND
    assert speed.low[behind].min() < -4500  # it turns the other way, and runs up
    assert current.high[current.t > verdict.t_end + SECOND].max() < 10 < current.high.max()
    assert [stay.name for stay in odd.stays] == ["off", "idle", "soft start", "operating"]
    assert [mark.event.kind for mark in odd.marks if mark.event.kind not in {"mode", "parameter"}] == ["motor"]
    assert [found.events[mark.number - 1] for mark in odd.marks] == [mark.event for mark in odd.marks]
    assert lane(minute, "commands").strands["commanded"].high.max() > 95
    assert 47 < lane(minute, "supply").strands["voltage"].low.min() < 48
    (flight,) = minute.flights
    assert flight[2].end == "cut"


@pytest.mark.parametrize("name", ["propeller-lost.log", "gps-restart.log", "esc-failure.mcap", "control-lost.log"])
def test_the_onset_is_on_it_and_it_is_a_minute_at_most(name: str) -> None:
    found = of(name)
    for line in found.timelines:
        assert line.onset is not None
        assert line.start <= line.onset[0] <= line.onset[1] <= line.end
        assert line.end - line.start <= LONGEST


@pytest.mark.slow
def test_of_a_long_flight_it_is_the_minute_around_the_onset_and_the_moment() -> None:
    found = flown("motor-stall", seconds=130, seed=5)
    minute, moment = found.timelines
    assert minute.end - minute.start == LONGEST
    assert minute.onset == moment.onset == (found.first.t, found.first.t_end)
    assert moment.end - moment.start < 5 * SECOND
    points = lane(moment, "device", found.first.ch).strands["speed"]
    assert np.diff(points.t).max() <= 60 * MILLISECOND  # each report, not what is left of a minute


def test_a_device_that_is_silent_has_no_line_and_no_mode() -> None:
    found = flown("esc-power", seconds=12, seed=3)
    gone = lane(found.timelines[0], "device", found.first.ch)
    assert max(stay.end for stay in gone.stays) <= found.first.t_end
    assert gone.strands["speed"].t.max() <= found.first.t_end
    others = [one for one in found.timelines[0].lanes if one.kind == "device" and one is not gone]
    assert all(one.strands["speed"].t.max() > found.first.t_end + SECOND for one in others)


def test_who_has_nothing_to_draw_has_a_lane_for_what_happened_to_it() -> None:
    line = of("gps-restart.log").timelines[0]
    (mine,) = [one for one in line.lanes if one.node == 42]
    assert mine.kind == "node"
    assert not mine.strands
    assert {"silence", "restart"} <= {mark.event.kind for mark in mine.marks}
    assert max(mark.end - mark.start for mark in mine.marks) > 10 * SECOND  # Fix2 is away so long


def test_a_hole_of_the_recording_is_empty_and_told() -> None:
    line = of("recorder-overload.log").timelines[0]
    assert len(line.breaks) >= 5
    for one in line.breaks:
        for each in line.lanes:
            for strand in each.strands.values():
                inside = (strand.t > one.start + 30 * MILLISECOND) & (strand.t < one.end - 30 * MILLISECOND)
                assert not inside.any()


def test_without_a_flight_or_a_wish_nothing_is_drawn() -> None:
    assert of("startup.log").timelines == ()
    run = Run(Request((str(CAPTURES / "propeller-lost.log"),)))
    triage = RunTriage(run)
    for _ in triage.over(run.inside()):
        pass
    assert triage.found().timelines == ()
