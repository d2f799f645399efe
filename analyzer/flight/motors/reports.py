"""Reports of ESCs, device by device, each with what it was commanded before; read once for all who look at them.

An ESC that has no number in its reports is commanded as the channel that it has told.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from analyzer.devices.rows import split
from analyzer.flight.motors.commanded import RecentOrders
from analyzer.flight.motors.halves import SupplyHalves, speeds_alone, supply_alone

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
        self.orders, self._halves = RecentOrders(), SupplyHalves()
        self._reader, self._commands, self._channels = order.reader, commands, order.channels
        self._plots = [plot for plot in order.plots if _tells(plot)]

    def feed(self, batch: Batch) -> None:
        """Take the next batch: `now` are its reports, with plot and key of the device that they are of."""
        self.orders.feed(self._commands.now)
        tables = [table for plot in self._plots if (table := self._reader.table(plot, batch)) is not None]
        self._halves.feed([table for table in tables if supply_alone(table.plot)])
        self.now = [(table.plot, key, some) for table in tables for key, some in self._read(table)]

    def channel(self, plot: Plot, key: int) -> int | None:
        """Return the channel of a device as people count them; of one without a number that which it has told."""
        bus, node, _ = split(key)
        return channel(plot, key) if plot.who.column else self._channels.of(bus, node)

    def _read(self, table: ReportTable) -> Iterator[tuple[int, EscReports]]:
        esc, ordered = table.plot.esc, []
        for key, part, _ in table.devices:
            ch = self.channel(table.plot, key)
            if ch is not None:
                ordered.append((split(key)[0], ch, part))
        supply = esc.voltage, esc.current, esc.temperature
        told = self._halves.beside(table) if speeds_alone(table.plot) else [table.numbers(name) for name in supply]
        rows = self.orders.rows(ordered, [table.numbers(esc.rpm), *told, table.numbers(esc.reported)], table.at)
        for key, part, at in table.devices:
            yield key, EscReports(rows, part, at)


def channel(plot: Plot, key: int) -> int | None:
    """Return the channel of a device as people count them, None if its table numbers none."""
    return split(key)[2] + plot.who.first if plot.who.column and plot.who.first else None


def _tells(plot: Plot) -> bool:
    esc = plot.esc
    return bool(esc.rpm or esc.voltage or esc.current or esc.temperature)
