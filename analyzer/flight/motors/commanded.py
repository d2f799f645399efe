"""What each motor was commanded before a report."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer import _native
from analyzer.decode.sent import cells
from analyzer.flight.thresholds import lasting

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.flight.clock import Places
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


class _Orders(NamedTuple):
    """Commands of a bus: when, the last frame of each, and the command of each channel (rows)."""

    ran: Array
    frame_end: Array
    columns: Array


class RecentOrders:
    """Keeps the commands of a batch, and those of the window before it; `MOST_RECENT` of a bus."""

    def __init__(self) -> None:
        self._all: dict[int, _Orders] = {}

    def feed(self, commands: Sequence[Commands]) -> None:
        """Take those of the next batch."""
        for some in commands:
            first = some.plot.who.first
            columns = np.full((len(some.columns) + first, len(some.at)), np.nan, np.float32)
            columns[first:] = some.columns
            ran, ends = some.at.ran, some.at.frame_end
            known = self._all.get(some.bus)
            if known is not None and len(known.columns) == len(columns):
                kept = int(np.searchsorted(known.ran, known.ran[-1] - 2 * lasting("motor_window")))
                kept = max(kept, len(known.ran) - MOST_RECENT)
                ran, ends = np.concatenate((known.ran[kept:], ran)), np.concatenate((known.frame_end[kept:], ends))
                columns = np.concatenate((known.columns[:, kept:], columns), axis=1)
            self._all[some.bus] = _Orders(np.maximum.accumulate(ran), np.maximum.accumulate(ends), columns)

    def before(self, bus: int, ch: int, at: Places) -> CommandWindow | None:
        """Return the commands of a channel before reports; None if the bus has none for it.

        Commands count that were whole before a report began, however batches are cut.
        """
        orders = self._all.get(bus)
        if orders is None or ch >= len(orders.columns):
            return None
        given = orders.ran, orders.frame_end, orders.columns[ch]
        found = _native.ordered(given, at.ran, at.frame, lasting("motor_window"))
        return CommandWindow(*(cells(column, np.float64) for column in found))
