"""Times in which a whole bus was silent: whatever is missing was sent in them, or behind them."""

from __future__ import annotations

from bisect import bisect_left
from typing import TYPE_CHECKING

import numpy as np

from analyzer.rules.joint.times import LONGEST
from dissectors.kit import times_by_bus

if TYPE_CHECKING:
    from dissectors.kit import Array, View

_MOST = 256  # of a bus, the latest


class Silences:
    """Long silences of each bus."""

    def __init__(self) -> None:
        self._last: dict[int, int] = {}
        self._known: dict[int, list[tuple[int, int]]] = {}

    def feed(self, view: View) -> None:
        """Add a batch."""
        for one in times_by_bus(view.frames):
            bus, t = one.bus, one.t
            last, self._last[bus] = self._last.get(bus, int(t[0])), int(t[-1])
            if one.longest <= LONGEST and int(t[0]) - last <= LONGEST:
                continue
            whole = np.append(last, t)
            at = np.flatnonzero(np.diff(whole) > LONGEST)[-_MOST:]
            if len(at):
                new = zip(whole[at].tolist(), whole[at + 1].tolist(), strict=True)
                self._known[bus] = [*self._known.get(bus, ()), *new][-_MOST:]

    def shorten(self, bus: int, since: Array, until: Array) -> tuple[Array, Array]:
        """Let what is missing on a bus begin with the last silence.

        Return when each begins, and how long the bus was not silent meanwhile: too long for what ends before it begins.
        """
        took = until - since
        took[took < 0] = LONGEST + 1
        known = self._known.get(bus, [])
        begins = since.copy()
        for k in np.flatnonzero(until - since > LONGEST).tolist() if known else ():
            end = until.item(k)
            at = bisect_left(known, end, key=lambda silence: silence[1] + 1) - 1
            if at >= 0 and known[at][0] >= since[k]:
                begins[k], took[k] = known[at][0], end - known[at][1]
        return begins, took
