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
        for second in view.seconds:
            at = self._index(second.start)
            for series, much in ((self._frames, second.frames), (self._bits, second.bits)):
                counts = self._of(series, second.bus)
                if counts is not None:
                    counts[at] += much
        transfers = view.transfers
        known = transfers.t != NO_TIME
        t, key = transfers.t, transfers.bus.astype(np.int64) * _NODES + (transfers.src & 0x7F)
        if not known.all():
            t, key = t[known], key[known]
        if len(t):
            self._index(int(t.max()))
            at = np.maximum((t - self.start) // self.step, 0)
            for one, places in groups(key):
                counts = self._of(self._transfers, one)
                if counts is not None:
                    mine = at[places]
                    low = int(mine.min())
                    more = np.bincount(mine - low)
                    counts[low : low + len(more)] += more

    def frames(self, bus: int) -> tuple[int, ...]:
        """Return frames of an interface in each step."""
        return self._series(self._frames, bus)

    def bits(self, bus: int) -> tuple[int, ...]:
        """Return bits of an interface on the wire in each step."""
        return self._series(self._bits, bus)

    def transfers(self, bus: int, node: int) -> tuple[int, ...]:
        """Return transfers of a node in each step."""
        return self._series(self._transfers, bus * _NODES + node)

    def _index(self, t: int) -> int:
        """Return the step of a time; steps are widened until it is inside."""
        start = self.start or 0
        while (t - start) // self.step >= MOST_STEPS:
            self._double()
        at = max((t - start) // self.step, 0)
        self._last = max(self._last, at)
        return at

    def _of(self, series: dict[int, Array], key: int) -> Array | None:
        if key not in series and len(series) < MOST_KEYS:
            series[key] = np.zeros(MOST_STEPS, np.int64)
        return series.get(key)

    def _series(self, series: dict[int, Array], key: int) -> tuple[int, ...]:
        return tuple(series[key][: self._last + 1].tolist()) if key in series else ()

    def _double(self) -> None:
        self.step *= 2
        self._last //= 2
        for series in (self._frames, self._bits, self._transfers):
            for key, counts in series.items():
                halved = counts.reshape(-1, 2).sum(axis=1)
                series[key] = np.concatenate((halved, np.zeros(MOST_STEPS - len(halved), np.int64)))
