"""Flights, their events, and where on the lines of a plot they are marked: found while a run goes on, or a bus."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from analyzer.flight.finder import EventFinder
from analyzer.flight.flights import FlightFinder
from analyzer.flight.timeline.courses import Courses
from analyzer.flight.timeline.measured import measured

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pyarrow as pa

    from analyzer.decode.engine import Batch
    from analyzer.plot.happened import MarkedEvent
    from dissectors import Registry


class FoundMarks(NamedTuple):
    """The flights, `FLIGHTS`, and events that have not been told before."""

    flights: pa.Table
    events: Sequence[MarkedEvent]


class EventMarks:
    """Adds up batches, with the bounds of its parts. Raises `ProfileError` for a wrong `plots.toml`."""

    def __init__(self, registry: Registry) -> None:
        self._finder = EventFinder(registry)
        self._flights = FlightFinder(registry, self._finder.order)
        self._courses = Courses(self._finder.order, self._finder.commands)

    def feed(self, batch: Batch) -> None:
        """Add the next batch."""
        self._finder.feed(batch)
        self._flights.feed(batch)
        self._courses.feed(batch)

    def fresh(self) -> Sequence[MarkedEvent]:
        """Return the events that were told since the last time; a fault is told when it is over."""
        return [(one, measured(self._courses, one)) for one in self._finder.fresh()]

    def finish(self) -> FoundMarks:
        """Return the flights and the events that are left, after the last batch."""
        whole = self._finder.events()
        left = {id(one) for one in self._finder.fresh()}
        events = [(one, measured(self._courses, one)) for one in whole if id(one) in left]
        return FoundMarks(self._flights.finish(), events)
