"""Time stamps that go backward."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.tables import FRAME_ANOMALIES, distinct
from dissectors.frame_text import FrameNumber
from dissectors.kit import MILLISECOND, NO_TIME, Occurrences, Rule

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, View

_BACKWARDS = 1 << FRAME_ANOMALIES.index("time backwards")


class Backwards(Rule):
    """CAP-001: a time stamp before the last one of the same interface."""

    rules = ("CAP-001",)

    def __init__(self) -> None:
        self._last: dict[int, int] = {}

    def feed(self, view: View) -> Iterator[Occurrences]:
        """Yield frames that the native core marked; by how much they go back is looked up."""
        frames = view.frames
        if not len(frames):
            return
        if int(np.bitwise_or.reduce(frames.anomaly)) & _BACKWARDS:
            rows = np.flatnonzero(frames.anomaly & _BACKWARDS)
            back = self._steps(view, rows)
            yield view.among_frames(
                "CAP-001",
                rows,
                lambda row: {"milliseconds": back[row] / MILLISECOND, "frame": FrameNumber.at(frames.first + row)},
            )
        for bus in distinct(frames.bus):
            at = len(frames) - 1 - int(np.argmax(frames.bus[::-1] == bus))
            if frames.t[at] == NO_TIME:
                mine = np.flatnonzero((frames.bus == bus) & (frames.t != NO_TIME))
                at = int(mine[-1]) if len(mine) else -1
            if at >= 0:
                self._last[bus] = int(frames.t[at])

    def _steps(self, view: View, rows: Array) -> dict[int, int]:
        """Return how far back each row is."""
        t, bus = view.frames.t, view.frames.bus
        back: dict[int, int] = {}
        for one in np.unique(bus[rows]).tolist():
            mine = np.flatnonzero((bus == one) & (t != NO_TIME))
            times = np.concatenate(([self._last.get(one, NO_TIME)], t[mine]))
            here = np.searchsorted(mine, rows[bus[rows] == one])
            back |= dict(zip(mine[here].tolist(), (times[here] - times[here + 1]).tolist(), strict=True))
        return back
