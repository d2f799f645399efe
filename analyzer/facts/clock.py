"""The resolution of a capture's times: what its stamps promise may be more than its recorder kept."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.facts.traffic import times

if TYPE_CHECKING:
    from analyzer.decode.engine import Batch

FINE = 10_000_000  # ns; a step up to this is fine enough
_SHARED = 2  # frames with one time, on average, which one bus cannot send at one time


class TimeResolution:
    """Looks at the frames that go by until two times are near enough. Memory does not grow."""

    def __init__(self) -> None:
        self._fine = False
        self._last: int | None = None
        self._frames = self._steps = 0

    def feed(self, batch: Batch) -> None:
        """Add the next batch."""
        if not self._fine:
            self._add(batch)

    @property
    def coarse(self) -> bool:
        """Return whether frames share times, of which no two are as near as `FINE`."""
        return not self._fine and self._steps > 1 and self._frames >= _SHARED * self._steps

    def _add(self, batch: Batch) -> None:
        column, valid = times(batch.frames)
        t = column[valid]
        if not len(t):
            return
        apart = np.abs(np.diff(t, prepend=t[0] if self._last is None else self._last))
        moved = apart[apart > 0]
        self._fine = bool((moved <= FINE).any())
        self._frames += len(t)
        self._steps += len(moved)
        self._last = int(t[-1])
