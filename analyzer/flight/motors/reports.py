"""Reports of one ESC, with what it was commanded before each."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.devices import fields
from analyzer.devices.rows import keyed, split
from dissectors.kit.order import groups
from dissectors.times import NO_TIME

if TYPE_CHECKING:
    from collections.abc import Iterator

    import pyarrow as pa

    from analyzer.flight.clock import Places, RecordedClock
    from analyzer.flight.motors.commanded import CommandWindow, RecentOrders
    from dissectors import Registry
    from dissectors.kit import Array
    from dissectors.picture import Plot


class MotorReports(NamedTuple):
    """Speed without its sign in rpm, V, A, and what the ESC says it is commanded, in %; NaN where it tells none."""

    speed: Array
    volts: Array
    current: Array
    reported: Array
    command: CommandWindow
    at: Places

    def take(self, rows: slice) -> MotorReports:
        """Return some of them."""
        speed, volts, current, reported = (one[rows] for one in self[:4])
        return MotorReports(speed, volts, current, reported, self.command.take(rows), self.at.take(rows))


def reports(
    registry: Registry, plot: Plot, table: pa.RecordBatch, clock: RecordedClock, orders: RecentOrders
) -> Iterator[tuple[int, MotorReports]]:
    """Yield the device of a key, and those of its reports that have a time, a speed, a voltage and commands before."""
    table, device = keyed(table, plot.who)
    if not len(table):
        return
    of, at = registry.definition(plot.table), clock.of(table)
    named = (plot.esc.rpm, plot.esc.voltage, plot.esc.current, plot.esc.reported)
    speed, volts, current, reported = (_numbers(fields.column(of, table, name), len(table)) for name in named)
    good = (at.t != NO_TIME) & np.isfinite(speed) & (volts > 1)
    for key, rows in groups(device):
        bus, _, number = split(key)
        mine = rows[good[rows]]
        where = at.take(mine)
        found = orders.before(bus, number + plot.who.first, where) if len(mine) else None
        if found is not None:
            command, has = found
            if not has.all():
                mine, where = mine[has], where.take(has)
            values = (np.abs(speed[mine]), volts[mine], current[mine], reported[mine])
            yield key, MotorReports(*values, command, where)


def _numbers(found: list[fields.Column], count: int) -> Array:
    """Return a column as numbers, NaN where there is none."""
    if not found:
        return np.full(count, np.nan)
    values: Array = found[0].values.astype(np.float64)
    return values if found[0].has is None else np.where(found[0].has, values, np.nan)
