"""Measurements and commands of devices at the moments of events: where marks stand on their lines."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.flight.timeline.courses import QUANTITIES
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from analyzer.flight.log import FlightEvent
    from analyzer.flight.timeline.course import DeviceValues
    from analyzer.flight.timeline.courses import Courses
    from dissectors.kit import Array

COMMANDED, COMMANDED_CH = "commanded", "commanded_ch"
_TOLD = frozenset({"fault", "mode", "health", "sag"})  # kinds whose values are measured quantities
_QUIET = frozenset({"parameter", "save", "message", "join"})  # one mark is enough for these
_BACK = 60 * SECOND  # in which a report counts


def measured(courses: Courses, event: FlightEvent) -> Mapping[str, float]:
    """Return what was measured of the device of an event then, by quantity; of a silence the last before it.

    Of who commands it is the command, and whose: that of the event's channel, or else the highest one.
    """
    found = dict(_commanded(courses, event))
    for name, value in _reported(courses, event):
        found.setdefault(name, value)
        if event.kind in _QUIET:
            break
    if event.kind in _TOLD:
        found |= {name: value for name, value in event.values.items() if name in QUANTITIES}
    return found


def _reported(courses: Courses, event: FlightEvent) -> Iterator[tuple[str, float]]:
    for one in courses.devices.values():
        if (one.bus, one.node) == (event.bus, event.node) and (event.ch is None or one.ch in (event.ch, None)):
            for name, value in zip(QUANTITIES, _last(one.course, event), strict=False):
                if np.isfinite(value):
                    yield name, float(value)


def _commanded(courses: Courses, event: FlightEvent) -> Iterator[tuple[str, float]]:
    for one in courses.commands.values():
        if (one.bus, one.node) != (event.bus, event.node):
            continue
        values = _last(one.course, event)
        if not np.isfinite(values).any():
            continue
        ch = event.ch if event.ch is not None else one.first + int(np.nanargmax(values))
        if one.first <= ch < one.first + len(values) and np.isfinite(values[ch - one.first]):
            yield COMMANDED, float(values[ch - one.first])
            yield COMMANDED_CH, ch
        return


def _last(course: DeviceValues, event: FlightEvent) -> Array:
    """Return the values of the step of an event, or of the last one before it that has some; none if none has."""
    cut = course.cut(event.first.ran - _BACK, event.first.ran + 1)
    filled = np.isfinite(cut.high)
    if not filled.any():
        return np.zeros(0)
    last = filled.shape[1] - 1 - filled[:, ::-1].argmax(axis=1)
    found: Array = cut.high[np.arange(len(last)), last]
    return found
