"""Reports of ESCs, device by device, each with what it was commanded before; read once for all who look at them."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from analyzer.devices.rows import split
from analyzer.flight.motors.commanded import RecentOrders

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer import _native
    from analyzer.decode.engine import Batch
    from analyzer.flight.clock import RowPlaces
    from analyzer.flight.orders import CommandReader
    from analyzer.flight.reports import EventOrder
    from analyzer.flight.tables import ReportTable
    from dissectors.picture import Plot


class EscReports(NamedTuple):
    """The reports of one device: its `part` of the `rows` of a table, as the core has them, and their places."""

    rows: _native.EscRows
    part: slice
    at: RowPlaces


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
        esc, who, ordered = table.plot.esc, table.plot.who, []
        for key, part, _ in table.devices if who.column else ():
            bus, _, number = split(key)
            ordered.append((bus, number + who.first, part))
        names = esc.rpm, esc.voltage, esc.current, esc.temperature, esc.reported
        rows = self.orders.rows(ordered, [table.numbers(name) for name in names], table.at)
        for key, part, at in table.devices:
            yield key, EscReports(rows, part, at)


def channel(plot: Plot, key: int) -> int | None:
    """Return the channel of a device as people count them, None if its table numbers none."""
    return split(key)[2] + plot.who.first if plot.who.column and plot.who.first else None


def _tells(plot: Plot) -> bool:
    esc = plot.esc
    return bool(esc.rpm or esc.voltage or esc.current or esc.temperature)
