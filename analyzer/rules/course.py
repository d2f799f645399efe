"""Traffic over time: frames and bits by interface, transfers by node, in steps that grow with the capture."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import NO_TIME, SECOND, groups

if TYPE_CHECKING:
    from dissectors.kit import Array, View


MOST_STEPS = 2048  # as many, and two become one
MOST_KEYS = 4096
_NODES = 128


class Course:
    """Adds up batches. Steps begin at the first frame with a time; what lies before it counts in the first step."""

    def __init__(self) -> None:
        self.start: int | None = None
        self.step = SECOND
        self._last = 0
        self._frames: dict[int, Array] = {}  # by bus
        self._bits: dict[int, Array] = {}
        self._transfers: dict[int, Array] = {}  # by bus and node

    def feed(self, view: View) -> None:
        """Add the next batch."""
        if self.start is None:
            known = view.frames.t != NO_TIME
            if not known.any():
                return
            self.start = int(view.frames.t[int(np.argmax(known))])
        seconds = view.seconds
        if len(seconds.bus):
            at = self._steps(seconds.start)
            for one, places in groups(seconds.bus):
                self._add(self._frames, one, at[places], seconds.frames[places])
                self._add(self._bits, one, at[places], seconds.bits[places])
        transfers = view.transfers
        known = transfers.t != NO_TIME
        t, key = transfers.t, transfers.bus.astype(np.int64) * _NODES + (transfers.src & 0x7F)
        if not known.all():
            t, key = t[known], key[known]
        if len(t):
            at = self._steps(t)
            for one, places in groups(key):
                self._add(self._transfers, one, at[places])

    def frames(self, bus: int) -> tuple[int, ...]:
        """Return frames of an interface in each step."""
        return self._series(self._frames, bus)

    def bits(self, bus: int) -> tuple[int, ...]:
        """Return bits of an interface on the wire in each step."""
        return self._series(self._bits, bus)

    def transfers(self, bus: int, node: int) -> tuple[int, ...]:
        """Return transfers of a node in each step."""
        return self._series(self._transfers, bus * _NODES + node)

    def _steps(self, t: Array) -> Array:
        """Return the steps of times; steps are widened until all are inside."""
        start, latest = self.start or 0, int(t.max())
        while (latest - start) // self.step >= MOST_STEPS:
            self._double()
        self._last = max(self._last, (latest - start) // self.step)
        found: Array = np.maximum((t - start) // self.step, 0)
        return found

    def _add(self, series: dict[int, Array], key: int, at: Array, much: Array | None = None) -> None:
        """Add to some steps, 1 each unless it is said how much."""
        if key not in series and len(series) < MOST_KEYS:
            series[key] = np.zeros(MOST_STEPS, np.int64)
        if key in series:
            low = int(at.min())
            more = np.bincount(at - low, much).astype(np.int64)
            series[key][low : low + len(more)] += more

    def _series(self, series: dict[int, Array], key: int) -> tuple[int, ...]:
        return tuple(series[key][: self._last + 1].tolist()) if key in series else ()

    def _double(self) -> None:
        self.step *= 2
        self._last //= 2
        for series in (self._frames, self._bits, self._transfers):
            for key, counts in series.items():
                halved = counts.reshape(-1, 2).sum(axis=1)
                series[key] = np.concatenate((halved, np.zeros(MOST_STEPS - len(halved), np.int64)))
