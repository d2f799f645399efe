"""The commands of each motor before a report."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer import _native
from analyzer.decode.sent import cells
from analyzer.flight.thresholds import lasting

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.flight.clock import RowPlaces
    from analyzer.flight.orders import Commands
    from dissectors.kit import Array

MOST_RECENT = 4096  # commands within the window


class CommandWindow(NamedTuple):
    """The command before each report, within the window: least, most, mean and last, in %; NaN for none."""

    least: Array
    most: Array
    mean: Array
    last: Array

    def take(self, rows: Array | slice) -> CommandWindow:
        """Return that of some reports."""
        return CommandWindow(*(one[rows] for one in self))


class RecentOrders:
    """Keeps the commands of a batch, and those of the window before it; `MOST_RECENT` of a bus."""

    def __init__(self) -> None:
        self._native = _native.RecentOrders(lasting("motor_window"), MOST_RECENT)

    def feed(self, commands: Sequence[Commands]) -> None:
        """Take those of the next batch."""
        for some in commands:
            at, columns = some.at, np.ascontiguousarray(some.columns)
            self._native.feed((some.bus, some.plot.who.first), at.ran, at.frame_end, columns)

    def before(self, devices: Sequence[tuple[int, int, slice]], at: RowPlaces) -> CommandWindow:
        """Return the commands before reports: those of devices by bus, channel and rows; NaN if there are none.

        Commands count that were whole before a report began, however batches are cut.
        """
        rows = [(bus, ch, mine.start, mine.stop) for bus, ch, mine in devices]
        return CommandWindow(*(cells(column, np.float64) for column in self._native.before(rows, at.ran, at.frame)))
