"""Time lines of a flight: the minute that matters, and the moment in it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.flight.timeline.axis import TimelineAxis
from analyzer.flight.timeline.lanes import EventMark, TimeLane, lanes
from analyzer.flight.timeline.strands import StrandSpan
from dissectors.records import dataclass, field
from dissectors.times import MILLISECOND, SECOND

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analyzer.flight.clock import Spot
    from analyzer.flight.flights import Flight
    from analyzer.flight.log import FlightEvent
    from analyzer.flight.timeline.axis import AxisBreak
    from analyzer.flight.timeline.courses import Courses

LONGEST = 60 * SECOND
_BEHIND = 5 * SECOND  # that is shown behind a flight
_MOMENT, _WIDEST = 3 * SECOND, 12 * SECOND
_LEAST = 100 * MILLISECOND
_AFTER_END = 100 * MILLISECOND  # so that the end of a recording is seen


@dataclass(frozen=True, slots=True)
class TimeLine:
    """A span of time with its lanes. Times are ns on its axis: the capture's clock as it was at the onset.

    `onset` is the last good report and the first bad one; `flights` are from when to when they go, `recorded` is the
    recording.
    """

    start: int
    end: int
    onset: tuple[int, int] | None
    flights: Sequence[tuple[int, int, Flight]]
    recorded: tuple[int, int]
    lanes: Sequence[TimeLane] = field(default_factory=list)
    breaks: Sequence[AxisBreak] = ()


@dataclass(frozen=True, slots=True)
class Drawn:
    """The content of a drawing: courses, events, flights, the one that is judged, and where it began, if that is known.

    `first` and `last` are the recorded times of the first and the last frame.
    """

    courses: Courses
    events: Sequence[FlightEvent]
    flights: Sequence[Flight]
    flight: Flight
    onset: tuple[Spot, Spot] | None
    first: int
    last: int


def time_lines(drawn: Drawn) -> Iterator[TimeLine]:
    """Yield the last minute of the flight, or the one with the onset in its middle; then the moment around that."""
    onset, flight = drawn.onset, drawn.flight
    axis = TimelineAxis(drawn.events, flight.last if onset is None else onset[1])
    first, last = axis.at(drawn.first), axis.at(drawn.last) + _AFTER_END
    if onset is None:
        end = min(last, axis.at(flight.last.ran) + _BEHIND)
        yield _line(drawn, axis, max(first, end - LONGEST), end, None)
        return
    low, high = (axis.at(one.ran) for one in onset)
    middle = (low + high) // 2
    end = min(last, max(middle + LONGEST // 2, first + LONGEST))
    start = max(first, end - LONGEST)
    yield _line(drawn, axis, start, end, (low, high))
    around = min(max(_MOMENT, 2 * (high - low)), _WIDEST)
    near = max(start, high - around // 2), min(end, high + around // 2)
    if 3 * (near[1] - near[0]) < end - start:
        yield _line(drawn, axis, *near, (low, high))


def _line(drawn: Drawn, axis: TimelineAxis, start: int, end: int, onset: tuple[int, int] | None) -> TimeLine:
    end = max(end, start + _LEAST)
    span = StrandSpan(axis, start, end)
    marks = []
    for number, one in enumerate(drawn.events, 1):
        at = axis.at(one.first.ran)
        until = at if one.after is None else axis.at(one.after.ran)
        if start <= until and at <= end:
            marks.append(EventMark(number, max(at, start), min(until, end), one))
    flights = [(axis.at(one.first.ran), axis.at(one.last.ran), one) for one in drawn.flights]
    flights = [one for one in flights if one[0] < end and one[1] > start]
    breaks = [one for one in axis.breaks if one.start <= end and one.end >= start]
    recorded = axis.at(drawn.first), axis.at(drawn.last)
    return TimeLine(start, end, onset, flights, recorded, lanes(drawn.courses, span, marks), breaks)
