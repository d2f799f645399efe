"""Everything that finds events of flights, in one pass over the batches of a capture."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from analyzer.flight.commands import CommandEvents
from analyzer.flight.holes import hole_events
from analyzer.flight.log import EventLog, event_table
from analyzer.flight.motors.events import MotorEvents
from analyzer.flight.reading import FlightReading
from analyzer.flight.silences import SilenceEvents
from analyzer.flight.supply.sags import SagEvents
from analyzer.flight.told.nodes import NodeEvents
from analyzer.flight.told.parameter_services import ParameterServiceEvents
from analyzer.flight.told.parameters import ParameterEvents
from analyzer.flight.told.power_ups import PowerUpEvents
from analyzer.flight.told.states import StateEvents
from analyzer.flight.trouble import TroubleEvents

if TYPE_CHECKING:
    import pyarrow as pa

    from analyzer.decode.engine import Batch
    from analyzer.flight.autopilot.events import AutopilotEvents
    from analyzer.flight.autopilot.side import AutopilotSide
    from analyzer.flight.log import FlightEvent
    from analyzer.sources.dataflash import AutopilotLog
    from dissectors import Registry


class EventFinder:
    """Adds up batches, with the bounds of its parts; `more` is how many events it did not keep.

    Args:
        registry: the types. Raises `ProfileError` for a wrong `plots.toml`.
        log: what the vehicle's autopilot wrote, whose words become events, too, if it can be aligned.
    """

    def __init__(self, registry: Registry, log: AutopilotLog | None = None) -> None:
        self._log = EventLog()
        add = self._log.add
        self._reading = reading = FlightReading(registry, self._log)
        self._channels = reading.channels
        self.clock, self.commands, self.order, self.escs = reading.clock, reading.commands, reading.order, reading.escs
        order = self.order
        self.silences = silences = SilenceEvents(
            registry, self.clock, add, [plot.table for plot in self.commands.plots]
        )
        self.motors = motors = MotorEvents(order, self.escs)
        self._parts = (
            StateEvents(order), CommandEvents(self.commands, add), silences, SagEvents(order),
            motors, NodeEvents(order), TroubleEvents(self.clock, add),
            ParameterEvents(order), ParameterServiceEvents(order), PowerUpEvents(order),
        )  # fmt: skip
        self._told: AutopilotEvents | None = None
        if log is not None:
            from analyzer.flight.autopilot.events import AutopilotEvents  # noqa: PLC0415 - few captures have one

            self._told = AutopilotEvents(log, order)

    def feed(self, batch: Batch) -> None:
        """Add the next batch."""
        self._reading.feed(batch)
        for part in self._parts:
            part.feed(batch)
        if self._told is not None:
            self._told.feed(batch)

    def release(self) -> None:
        """Let the batch go, once those who share its reading have looked at it, too."""
        self._reading.release()

    def finish(self) -> pa.Table:
        """Return the events in the order of the capture: `FLIGHT_EVENTS`."""
        return event_table(self.events())

    def events(self) -> list[FlightEvent]:
        """Return the events in the order of the capture, after the last batch."""
        for part in self._parts:
            part.finish()
        if self._told is not None:
            self._told.finish()
        return self._log.events(self._channels, hole_events(self.clock))

    def fresh(self) -> list[FlightEvent]:
        """Return the events that were told since the last time, in no order; a fault is told when it is over."""
        return self._log.fresh(self._channels)

    @property
    def autopilot(self) -> dict[str, Any] | None:
        """The fate of the autopilot's log, after `finish`, as `Alignment.plain` has it; None without a log."""
        return None if self._told is None else self._told.plain()

    @property
    def side(self) -> AutopilotSide | None:
        """Measurements of the autopilot's log in the time of the capture, after `finish`; None if that is not known."""
        return None if self._told is None else self._told.side

    @property
    def notes(self) -> list[str]:
        """Remarks on the autopilot's log, after `finish`."""
        return [] if self._told is None else self._told.notes

    @property
    def more(self) -> int:
        """How many events there are beside those that are kept."""
        return self._log.more
