"""The reading that all finders share: the clock of a capture, its commands and the reports of its ESCs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.flight.clock import RecordedClock
from analyzer.flight.motors.reports import EscReader
from analyzer.flight.orders import CommandReader
from analyzer.flight.reports import EventOrder
from analyzer.flight.tables import ReportReader
from analyzer.flight.told.channels import ToldChannels
from dissectors import picture

if TYPE_CHECKING:
    from analyzer.decode.engine import Batch
    from analyzer.flight.log import EventLog, FlightEvent
    from dissectors import Registry


def _untold(_: FlightEvent) -> None:
    """Take an event that nobody wants to hear of."""


def _unwanted(*_: object) -> bool:
    """Return that nobody wants to hear of an event."""
    return False


class FlightReading:
    """Reads each batch once for all who look at it, before they do.

    Args:
        registry: the types. Raises `ProfileError` for a wrong `plots.toml`.
        log: takes the events; None if nobody wants to hear of them.
    """

    def __init__(self, registry: Registry, log: EventLog | None = None) -> None:
        self.clock = RecordedClock()
        plots = tuple(picture.load(registry).plots.values())
        reader = ReportReader(registry, self.clock)
        self.commands = CommandReader(registry, plots, self.clock, reader)
        self.channels = ToldChannels(registry, reader)
        add, spare = (_untold, _unwanted) if log is None else (log.add, log.spare)
        self.order = EventOrder(registry, plots, self.clock, add, reader, self.channels, spare)
        self.escs = EscReader(self.order, self.commands)

    def feed(self, batch: Batch) -> None:
        """Take the next batch."""
        self.clock.feed(batch)
        self.channels.feed(batch)
        self.commands.feed(batch)
        self.escs.feed(batch)

    def release(self) -> None:
        """Let all of the batch go, once everybody has looked at it: the rules need the memory."""
        self.clock.release()
        self.order.reader.release()
        self.commands.now, self.escs.now = [], []
