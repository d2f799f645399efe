"""Reports of ESCs, device by device, each with what it was commanded before; read once for all who look at them."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.devices.rows import split
from analyzer.flight.motors.commanded import CommandWindow, RecentOrders

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.decode.engine import Batch
    from analyzer.flight.clock import RowPlaces
    from analyzer.flight.orders import CommandReader
    from analyzer.flight.reports import EventOrder
    from analyzer.flight.tables import ReportTable
    from dissectors.kit import Array
    from dissectors.picture import Plot


class EscReports(NamedTuple):
    """Speed without its sign in rpm, V, A, degC, and what the ESC says it is commanded, in %; NaN where it tells none.

    `command` is NaN where nothing was commanded before.
    """

    speed: Array
    volts: Array
    current: Array
    temperature: Array
    reported: Array
    command: CommandWindow
    at: RowPlaces

    def take(self, rows: Array | slice) -> EscReports:
        """Return some of them."""
        speed, volts, current, temperature, reported = (one[rows] for one in self[:5])
        return EscReports(
            speed, volts, current, temperature, reported, self.command.take(rows), self.at.take(rows)
        )  # fmt: skip


class EscReader:
    """Reads the reports of each batch that have a time; `clock` and `commands` are fed before.

    Args:
        order: the types, what is known of their tables, and the clock.
        commands: of the batch.
    """

    def __init__(self, order: EventOrder, commands: CommandReader) -> None:
        self.now: list[tuple[Plot, int, EscReports]] = []
        self.orders = RecentOrders()
        self._reader, self._commands = order.reader, commands
        self._plots = [plot for plot in order.plots if _tells(plot)]

    def feed(self, batch: Batch) -> None:
        """Take the next batch: `now` are its reports, with plot and key of the device that they are of."""
        self.orders.feed(self._commands.now)
        self.now = [
            (plot, key, some)
            for plot in self._plots
            if (table := self._reader.table(plot, batch)) is not None
            for key, some in self._read(table)
        ]

    def _read(self, table: ReportTable) -> Iterator[tuple[int, EscReports]]:
        esc = table.plot.esc
        names = esc.rpm, esc.voltage, esc.current, esc.temperature, esc.reported
        speed, volts, current, temperature, reported = (table.numbers(name) for name in names)
        speed = np.abs(speed)
        who, ordered = table.plot.who, []
        for key, rows, _ in table.devices if who.column else ():
            bus, _, number = split(key)
            ordered.append((bus, number + who.first, rows))
        command = self.orders.before(ordered, table.at)
        for key, rows, at in table.devices:
            yield key, EscReports(
                speed[rows], volts[rows], current[rows], temperature[rows], reported[rows], command.take(rows), at
            )  # fmt: skip


def channel(plot: Plot, key: int) -> int | None:
    """Return the channel of a device as people count them, None if its table numbers none."""
    return split(key)[2] + plot.who.first if plot.who.column and plot.who.first else None


def _tells(plot: Plot) -> bool:
    esc = plot.esc
    return bool(esc.rpm or esc.voltage or esc.current or esc.temperature)
