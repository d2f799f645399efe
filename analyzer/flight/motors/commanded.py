"""The reports of motors, each with what was commanded before it, for the core."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer import _native
from analyzer.flight.thresholds import lasting

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.flight.clock import RowPlaces
    from analyzer.flight.orders import Commands
    from dissectors.kit import Array

MOST_RECENT = 4096  # commands within the window


class RecentOrders:
    """Keeps the commands of a batch, and those of the window before it; `MOST_RECENT` of a bus."""

    def __init__(self) -> None:
        self._native = _native.RecentOrders(lasting("motor_window"), MOST_RECENT)

    def feed(self, commands: Sequence[Commands]) -> None:
        """Take those of the next batch."""
        for some in commands:
            at, columns = some.at, np.ascontiguousarray(some.columns)
            self._native.feed((some.bus, some.plot.who.first), at.ran, at.frame_end, columns)

    def rows(
        self, devices: Sequence[tuple[int, int, slice]], values: Sequence[Array], at: RowPlaces
    ) -> _native.EscRows:
        """Return reports with what was commanded before each: those of devices by bus, channel and rows.

        Commands count that were whole before a report began, however batches are cut. `values` are speeds, V, A, degC,
        and what ESCs say they are commanded, in %; NaN where they tell none.
        """
        places = [(bus, ch, mine.start, mine.stop) for bus, ch, mine in devices]
        return self._native.rows(places, tuple(values), (at.ran, at.t, at.step, at.frame))
