"""Reports of ESCs, device by device, each with what it was commanded before; read once for all who look at them."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.devices import fields
from analyzer.devices.rows import keyed, split, usable
from analyzer.flight.motors.commanded import CommandWindow, RecentOrders
from dissectors.kit.order import groups
from dissectors.times import NO_TIME

if TYPE_CHECKING:
    from collections.abc import Iterator

    import pyarrow as pa

    from analyzer.decode.engine import Batch
    from analyzer.flight.clock import Places
    from analyzer.flight.orders import CommandReader
    from analyzer.flight.reports import EventOrder
    from dissectors import Registry
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
    at: Places

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
        self._registry, self._clock, self._commands = order.registry, order.clock, commands
        self._plots = [plot for plot in order.plots if _tells(plot)]

    def feed(self, batch: Batch) -> None:
        """Take the next batch: `now` are its reports, with plot and key of the device that they are of."""
        self.orders.feed(self._commands.now)
        self.now = [
            (plot, key, some)
            for plot in self._plots
            if (table := batch.messages.get(plot.table)) is not None
            for key, some in self._read(plot, usable(table))
        ]

    def _read(self, plot: Plot, table: pa.RecordBatch) -> Iterator[tuple[int, EscReports]]:
        table, device = keyed(table, plot.who)
        if not len(table):
            return
        at = self._clock.of(table)
        names = (plot.esc.rpm, plot.esc.voltage, plot.esc.current, plot.esc.temperature, plot.esc.reported)
        speed, volts, current, temperature, reported = (_numbers(self._registry, plot, table, name) for name in names)
        timed = at.t != NO_TIME
        for key, rows in groups(device):
            mine = rows[timed[rows]]
            if len(mine):
                where = at.take(mine)
                yield key, EscReports(
                    np.abs(speed[mine]), volts[mine], current[mine], temperature[mine], reported[mine],
                    self._commanded(plot, key, where), where,
                )  # fmt: skip

    def _commanded(self, plot: Plot, key: int, at: Places) -> CommandWindow:
        bus, _, number = split(key)
        found = self.orders.before(bus, number + plot.who.first, at) if plot.who.column else None
        if found is not None and found[1].all():
            return found[0]
        whole = CommandWindow(*(np.full(len(at), np.nan) for _ in CommandWindow._fields))
        if found is not None:
            for all_, some in zip(whole, found[0], strict=True):
                all_[found[1]] = some
        return whole


def channel(plot: Plot, key: int) -> int | None:
    """Return the channel of a device as people count them, None if its table numbers none."""
    return split(key)[2] + plot.who.first if plot.who.column and plot.who.first else None


def _tells(plot: Plot) -> bool:
    esc = plot.esc
    return bool(esc.rpm or esc.voltage or esc.current or esc.temperature)


def _numbers(registry: Registry, plot: Plot, table: pa.RecordBatch, name: str) -> Array:
    """Return a column as numbers, NaN where there is none."""
    found = fields.column(registry.definition(plot.table), table, name) if name else []
    if not found:
        return np.full(len(table), np.nan)
    values: Array = found[0].values.astype(np.float64)
    return values if found[0].has is None else np.where(found[0].has, values, np.nan)
