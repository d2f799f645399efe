"""What devices measured, and were commanded, at the moments of events: the values that a mark on a line needs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.flight.timeline.courses import QUANTITIES
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from analyzer.flight.log import FlightEvent
    from analyzer.flight.timeline.course import Course, CourseCut
    from analyzer.flight.timeline.courses import Courses, DeviceCourse
    from dissectors.kit import Array

COMMANDED, COMMANDED_CH = "commanded", "commanded_ch"
_BACK = 60 * SECOND  # in which a report counts


def complete(courses: Courses, events: Iterable[FlightEvent]) -> None:
    """Give events what was measured of their device then, as far as they do not say it themselves.

    A silence has the last values before it. Commands without a channel get that of the highest one.
    """
    for one in events:
        if one.bus is None or one.node is None or one.source != "bus":
            continue
        found = dict(_commanded(courses, one))
        for device in _devices(courses, one):
            values = _last(device.course, one)
            if values is not None:
                found |= {
                    name: round(float(value), 3)
                    for name, value in zip(QUANTITIES, values, strict=True)
                    if np.isfinite(value) and name not in found
                }
        if found:
            one.values = {**found, **one.values}


def _devices(courses: Courses, event: FlightEvent) -> Iterator[DeviceCourse]:
    for one in courses.devices.values():
        if (one.bus, one.node) == (event.bus, event.node) and (event.ch is None or one.ch in (event.ch, None)):
            yield one


def _commanded(courses: Courses, event: FlightEvent) -> Iterator[tuple[str, float]]:
    """Yield what the sender of an event commanded then, if it commands: of its channel, or of the highest."""
    for one in courses.commands.values():
        if (one.bus, one.node) != (event.bus, event.node):
            continue
        values = _last(one.course, event)
        if values is None or not np.isfinite(values).any():
            continue
        ch = event.ch if event.ch is not None else one.first + int(np.nanargmax(values))
        if one.first <= ch < one.first + len(values) and np.isfinite(values[ch - one.first]):
            yield COMMANDED, round(float(values[ch - one.first]), 3)
            yield COMMANDED_CH, ch
        return


def _last(course: Course, event: FlightEvent) -> Array | None:
    """Return the values of the step of an event, or of the last one before it; None if there is none."""
    cut: CourseCut = course.cut(event.first.ran - _BACK, event.first.ran + 1)
    if not len(cut.start):
        return None
    filled = np.isfinite(cut.high)
    last = np.where(filled.any(axis=1), cut.high.shape[1] - 1 - filled[:, ::-1].argmax(axis=1), 0)
    found: Array = cut.high[np.arange(len(last)), last]
    return found
