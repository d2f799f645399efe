"""Two nodes that send the time within a short while."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from dissectors.kit import NO_TIME, SECOND, Occurrence, Rule

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import View

TIME_SYNC = "uavcan.protocol.GlobalTimeSync"
MOST = 4096  # unique IDs, or time masters


class TimeMasters(Rule):
    """Two nodes that send the time within a short while."""

    rules: ClassVar[tuple[str, ...]] = ("BUS-031",)

    def __init__(self) -> None:
        self._last: dict[tuple[int, int], int] = {}

    def feed(self, view: View) -> Iterator[Occurrence]:
        """Yield each time that came soon after another node's."""
        table = view.table(TIME_SYNC)
        if table is None:
            return
        window = view.number("BUS-031", "window_s") * SECOND
        for row in np.flatnonzero(table.trusted & (table.t != NO_TIME)).tolist():
            t, bus, src = int(table.t[row]), int(table.bus[row]), int(table.src[row])
            for (other_bus, other), at in self._last.items():
                if other_bus == bus and other != src and t - at <= window:
                    first, second = sorted((src, other))
                    values = {"first_node": first, "second_node": second}
                    frames = tuple(view.transfers.frames(int(table.row[row])))
                    yield Occurrence("BUS-031", t, bus, second, TIME_SYNC, frames, values)
            if len(self._last) < MOST:
                self._last[bus, src] = t
