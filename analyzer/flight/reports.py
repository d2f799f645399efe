"""The common part of what finds events in reports and commands that `plots.toml` speaks of."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from analyzer.flight.clock import RecordedClock
    from analyzer.flight.log import FlightEvent
    from analyzer.flight.tables import ReportReader
    from analyzer.flight.told.channels import ToldChannels
    from dissectors import Registry
    from dissectors.picture import Plot


class EventOrder(NamedTuple):
    """The types, what is known of their tables, the clock of the capture, fed before, and who takes the events.

    `reader` reads the tables of a batch, `channels` are those that nodes told, fed before, too. `spare` says whether
    one more event of a kind, bus, node and type is wanted; one that is not has been counted.
    """

    registry: Registry
    plots: Sequence[Plot]
    clock: RecordedClock
    add: Callable[[FlightEvent], None]
    reader: ReportReader
    channels: ToldChannels
    spare: Callable[[str, int, int, str], bool]


class ReportEvents(ABC):
    """Adds up batches of the tables that are of use to it."""

    def __init__(self, order: EventOrder) -> None:
        self._registry, self._clock, self._add, self._reader = order.registry, order.clock, order.add, order.reader
        self._plots = [plot for plot in order.plots if self.of_use(plot)]

    @staticmethod
    @abstractmethod
    def of_use(plot: Plot) -> bool:
        """Return whether a table tells what it looks for."""
