"""Time stamps that go backward."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.rules.anomalies import flagged
from analyzer.tables import FRAME_ANOMALIES
from dissectors.frame_text import FrameNumber
from dissectors.kit import MILLISECOND, NO_TIME, Occurrences, Rule, times_by_bus

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from dissectors.kit import Array, BusTimes, View

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
        rows = flagged(frames.anomaly, _BACKWARDS)
        times = times_by_bus(frames)
        if len(rows):
            back = self._steps(view, rows, times)
            yield view.among_frames(
                "CAP-001",
                rows,
                lambda row: {
                    "milliseconds": back.item(rows.searchsorted(row)) / MILLISECOND,
                    "frame": FrameNumber.at(frames.first + row),
                },
            )
        for one in times:
            self._last[one.bus] = one.t.item(-1)

    def _steps(self, view: View, rows: Array, times: Sequence[BusTimes]) -> Array:
        """Return how far back each row is."""
        back = np.zeros(len(rows), np.int64)
        for one in times:
            some = slice(None) if one.rows is None else (view.frames.bus[rows] == one.bus).nonzero()[0]
            mine = rows[some] if one.rows is None else one.rows.searchsorted(rows[some])
            before = one.t[mine - 1]
            before[mine == 0] = self._last.get(one.bus, NO_TIME)
            back[some] = before - one.t[mine]
        return back
