"""What each motor was commanded lately."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.flight.thresholds import lasting

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.flight.orders import Commands
    from dissectors.kit import Array

MOST_RECENT = 4096  # commands within the window


class ChannelOrders(NamedTuple):
    """Commands of a channel in order: when (i64, ns), the last frame of each (i64), and how much, in % (f32)."""

    ran: Array
    frame_end: Array
    percent: Array


class _Orders(NamedTuple):
    """Commands of a bus: when, the last frame of each, and the command of each channel (rows)."""

    ran: Array
    frame_end: Array
    columns: Array


class RecentOrders:
    """Keeps the commands of a batch, and those of the window before it; `MOST_RECENT` of a bus."""

    def __init__(self) -> None:
        self._all: dict[int, _Orders] = {}

    def __bool__(self) -> bool:
        """Return whether there are any."""
        return bool(self._all)

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

    def of(self, bus: int, ch: int) -> ChannelOrders | None:
        """Return the commands of a channel; None if the bus has none for it."""
        orders = self._all.get(bus)
        if orders is None or ch >= len(orders.columns):
            return None
        return ChannelOrders(orders.ran, orders.frame_end, orders.columns[ch])
