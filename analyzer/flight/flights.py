"""Flights: when motors turned, or else were commanded to, or else the vehicle was armed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from analyzer.decode.columns import senders
from analyzer.devices.rows import split
from analyzer.flight.basis import FlightBasis
from analyzer.flight.clock import RecordedClock
from analyzer.flight.orders import by_sender, orders
from analyzer.flight.tables import ReportReader
from analyzer.flight.thresholds import idle_rpm, lasting, threshold
from analyzer.flight.told.channels import ToldChannels
from analyzer.tables import FLIGHTS
from dissectors import picture
from dissectors.kit.cells import numbers
from dissectors.kit.order import groups
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Hashable

    from analyzer.decode.engine import Batch
    from analyzer.flight.basis import Stretch
    from analyzer.flight.clock import Spot
    from analyzer.flight.reports import EventOrder
    from analyzer.flight.tables import ReportTable
    from dissectors import Registry
    from dissectors.picture import Plot

ARMING = "uavcan.equipment.safety.ArmingStatus"
ARMED = 255
MOST_CHANNEL = 62


@dataclass(frozen=True, slots=True)
class Flight:
    """One flight: `end` is how it ended, `chs` the channels that turned, `by` what tells it."""

    number: int
    first: Spot
    last: Spot
    end: str
    chs: tuple[int, ...]
    by: str
    frame_end: int


class FlightFinder:
    """Adds up batches, with the bounds of `FlightBasis`.

    Args:
        registry: the types. Raises `ProfileError` for a wrong `plots.toml`.
        order: the clock of the capture, and its reader and channels, if somebody else feeds them before.
    """

    def __init__(self, registry: Registry, order: EventOrder | None = None) -> None:
        self._registry = registry
        self._own_clock = order is None
        plots = picture.load(registry).plots.values()
        self._reports = [plot for plot in plots if plot.esc.rpm]
        self._orders = [plot for plot in plots if plot.esc.commanded]
        self._clock = RecordedClock() if order is None else order.clock
        self._reader = ReportReader(registry, self._clock) if order is None else order.reader
        self._channels = ToldChannels(registry, self._reader) if order is None else order.channels
        self._by = {
            "telemetry": FlightBasis(self._clock, lasting("silent_motor")),
            "commands": FlightBasis(self._clock, lasting("silent_motor")),
            "arming": FlightBasis(self._clock, lasting("silent_arming")),
        }
        self._last_frame = -1

    def feed(self, batch: Batch) -> None:
        """Add the next batch."""
        if self._own_clock:
            self._clock.feed(batch)
            self._channels.feed(batch)
        self._last_frame = max(self._last_frame, batch.first_frame + len(batch.frames) - 1)
        for plot in self._reports:
            if (read := self._reader.table(plot, batch)) is not None:
                self._feed_reports(read)
        if self._by["telemetry"].heard:  # what says less is not asked any more
            return
        for plot in self._orders:
            if (table := self._reader.rows(plot.table, batch)) is not None:
                self._feed_orders(plot, table)
        if self._by["commands"].heard:
            return
        table = self._reader.rows(ARMING, batch)
        if table is not None and "status" in table.schema.names:  # a folder may have another type of this name
            self._feed_arming(table)

    def flights(self) -> list[Flight]:
        """Return the flights in the order of the capture."""
        by = next((name for name, basis in self._by.items() if basis.heard), "telemetry")
        end = self._clock.ran
        found = []
        for number, one in enumerate([] if end is None else self._by[by].stretches(), 1):
            how = _end(one, end or 0, lasting("silent_arming" if by == "arming" else "lost"))
            frame_end = self._last_frame if how == "cut" else one.last.frame_end
            found.append(Flight(number, one.first, one.last, how, tuple(self._chs(one)), by, frame_end))
        return found

    def finish(self) -> pa.Table:
        """Return the flights in the order of the capture: `FLIGHTS`."""
        rows = [
            {
                "flight": one.number, "t": one.first.t, "t_end": one.last.t, "ran": one.last.ran - one.first.ran,
                "end": one.end, "chs": list(one.chs), "by": one.by, "frame": one.first.frame,
                "frame_end": one.frame_end,
            }
            for one in self.flights()
        ]  # fmt: skip
        return pa.Table.from_pylist(rows, schema=FLIGHTS)

    def _chs(self, one: Stretch) -> list[int]:
        """Return the channels of those that turned; whose node is all that is known, it is the one it told."""
        told = (self._channels.of(*who) if isinstance(who, tuple) else who for who in one.who)
        return sorted({ch for ch in told if isinstance(ch, int)})

    def _feed_reports(self, read: ReportTable) -> None:
        """Take what ESCs say of their speeds."""
        plot, rpm = read.plot, read.numbers(read.plot.esc.rpm)
        known, on = ~np.isnan(rpm), np.abs(rpm) > idle_rpm(plot)
        whole = bool(known.all())
        for key, rows, at in read.devices:
            bus, node, number = split(key)
            who: Hashable = number + plot.who.first if plot.who.column else (bus, node)
            turns, where = (on[rows], at) if whole else (on[rows][known[rows]], at.take(known[rows]))
            self._by["telemetry"].feed((plot.table, key), turns, where, who)

    def _feed_orders(self, plot: Plot, table: pa.RecordBatch) -> None:
        """Take what ESCs are commanded."""
        found = orders(self._registry, plot, table)
        if found is None:
            return
        at, chs, idle = self._clock.of(table), np.zeros(len(table), np.int64), threshold("command_idle_percent")
        for place, column in enumerate(found.columns):
            chs |= (column > idle).astype(np.int64) << min(place + plot.who.first, MOST_CHANNEL)
        for key, rows in by_sender(found.sender, np.ones(len(table), bool)):
            self._by["commands"].feed((plot.table, key), chs[rows] != 0, at.take(rows), chs=chs[rows])

    def _feed_arming(self, table: pa.RecordBatch) -> None:
        on, at = numbers(table.column("status")) == ARMED, self._clock.of(table)
        for key, rows in groups(senders(table)):
            self._by["arming"].feed(key, on[rows], at.take(rows))


def _end(one: Stretch, end: int, silent: int) -> str:
    """Return how a flight ended; `end` is that of the recording, `silent` what its reports leave out at most."""
    if one.over:
        return "lost" if one.silent else "landed"
    return "lost" if end - one.last.ran > silent else "cut"
