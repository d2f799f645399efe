"""All that triage looks at, in one pass: flights, events, and the measurements that speak for or against a cause."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from analyzer.flight.finder import EventFinder
from analyzer.flight.flights import FlightFinder
from analyzer.flight.odd.finder import OddFinder
from analyzer.flight.pulse import CommandPulse
from analyzer.flight.senders import LossesBySecond
from analyzer.flight.supply.extents import EscExtents
from analyzer.flight.supply.supply_lows import SupplyLows
from analyzer.flight.timeline.courses import Courses
from analyzer.flight.told.setups import Setups

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pyarrow as pa

    from analyzer.decode.engine import Batch
    from analyzer.flight.autopilot.side import AutopilotSide
    from analyzer.flight.clock import RecordedClock
    from analyzer.flight.flights import Flight
    from analyzer.flight.log import FlightEvent
    from analyzer.flight.odd.judge import OddReport
    from analyzer.flight.silences import SenderPace
    from analyzer.flight.supply.extents import EscExtent
    from analyzer.sources.dataflash import AutopilotLog
    from dissectors import Registry


class Witness:
    """Adds up batches, with the bounds of its parts.

    Args:
        registry: the types. Raises `ProfileError` for a wrong `plots.toml`.
        log: what the vehicle's autopilot wrote, whose words become events, too, if it can be aligned.
        drawn: keep the courses of what was measured and commanded, for a time line.
    """

    def __init__(self, registry: Registry, log: AutopilotLog | None = None, *, drawn: bool = False) -> None:
        self._finder = EventFinder(registry, log)
        self.clock: RecordedClock = self._finder.clock
        self._flights = FlightFinder(registry, self._finder.order)
        self.pulse = CommandPulse(self.clock, self._finder.commands)
        self.losses = LossesBySecond(self.clock)
        self._extents = EscExtents(self._finder.order)
        self.supply, self.setups = SupplyLows(self._finder.order), Setups(self._finder.order)
        self.courses = Courses(self._finder.order, self._finder.commands) if drawn else None
        self._odd = OddFinder(self.clock, self._finder.escs)

    def feed(self, batch: Batch) -> None:
        """Add the next batch."""
        self._finder.feed(batch)
        self._flights.feed(batch)
        self.pulse.feed()
        self.losses.feed(batch)
        self._extents.feed(batch)
        self.supply.feed(batch)
        self.setups.feed(batch)
        if self.courses is not None:
            self.courses.feed(batch)
        self._odd.feed()
        self._finder.release()

    def flights(self) -> list[Flight]:
        """Return the flights, after the last batch."""
        return self._flights.flights()

    def flight_table(self) -> pa.Table:
        """Return the flights as a table, after the last batch."""
        return self._flights.finish()

    def events(self) -> list[FlightEvent]:
        """Return the events, after the last batch, in the order of the capture."""
        return self._finder.events()

    def odd(self, flights: Sequence[Flight]) -> OddReport:
        """Return which ESCs are odd, after the last batch."""
        return self._odd.found(flights)

    @property
    def autopilot(self) -> dict[str, Any] | None:
        """The fate of the autopilot's log, after `events`; None without one."""
        return self._finder.autopilot

    @property
    def side(self) -> AutopilotSide | None:
        """Measurements of the autopilot's log in the time of the capture, after `events`; None if that is not known."""
        return self._finder.side

    @property
    def more(self) -> int:
        """How many events there are beside those that are kept."""
        return self._finder.more

    @property
    def command_types(self) -> frozenset[str]:
        """The types that command ESCs."""
        return frozenset(plot.table for plot in self._finder.commands.plots)

    def learned(self, bus: int, node: int) -> int | None:
        """Return when (recorded time) it was known what an ESC's motors do at a command; None if it never was."""
        return self._finder.motors.learned(bus, node)

    @property
    def escs(self) -> list[EscExtent]:
        """The ESCs that reported."""
        return self._extents.all

    @property
    def paces(self) -> list[SenderPace]:
        """The pace of each sender and type."""
        return self._finder.silences.paces()
