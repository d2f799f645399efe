"""Times in which nothing of any interface was recorded: what is on one side of them says nothing of the other."""

from __future__ import annotations

from bisect import bisect_right
from itertools import accumulate
from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import SECOND

if TYPE_CHECKING:
    from dissectors.kit import Array

GAP = SECOND  # without a frame of any interface
_MOST = 4096
_BUSY, _SILENT = 16, 8  # a gap this many times as long as the last frames took hides something
_NEVER = 1 << 62


class CaptureGaps:
    """Gaps of a capture, the latest ones: `known` says since when, until when, and whether each hides something.

    `ends` are their ends.
    """

    def __init__(self) -> None:
        self.ends = np.empty(0, np.int64)
        self.known: list[tuple[int, int, bool]] = []
        self._ends: list[int] = []  # the ends: faster for one question
        self._hiding: list[int] = []  # when the first of a gap and those behind it began that hide something
        self._latest: Array = np.empty(0, np.int64)

    def feed(self, t: Array, *, calm: bool) -> int:
        """Add times; return the last one before them, the first of all if there is none.

        After a gap nothing came for longer than `GAP`. It is said to hide something where much was sent before it. A
        clock that is set back by as much begins anew, too. Among times that are `calm` there is none.
        """
        last = int(self._latest[-1]) if len(self._latest) else int(t[0])
        if not calm or abs(int(t[0]) - last) > GAP:
            self._add(t)
        self._latest = np.append(self._latest, t[-_BUSY:])[-_BUSY:]
        return last

    def _add(self, t: Array) -> None:
        known = len(self._latest)
        whole = np.concatenate((self._latest, t))
        apart = np.diff(whole[max(known - 1, 0) :])
        for at in np.flatnonzero(np.abs(apart) > GAP)[-_MOST:].tolist():
            end = at + max(known, 1)
            usual = whole[max(end - _BUSY, 0) : end]
            if apart[at] < 0:
                self.known[:] = [(int(whole[end]) - 1, int(whole[end]), False)]
                continue
            busy = len(usual) == _BUSY and int(apart[at]) > _SILENT * (int(usual[-1]) - int(usual[0]))
            self.known.append((int(whole[end - 1]), int(whole[end]), busy))
        del self.known[:-_MOST]
        self._hiding, self._ends = [], [end for _, end, _ in self.known]
        self.ends = np.array(self._ends, np.int64)

    def resumed(self, t: int, start: int) -> int:
        """Return the end of the last gap before a time, else the time at which the capture starts."""
        at = bisect_right(self._ends, t)
        return self._ends[at - 1] if at else start

    def paused(self, since: int, until: int) -> bool:
        """Return whether there is a gap somewhere between two times that hides something."""
        if not self._ends:
            return False
        if len(self._hiding) < len(self.known):
            self._hiding = [*accumulate((t if busy else _NEVER for t, _, busy in reversed(self.known)), min)][::-1]
        at = bisect_right(self._ends, since)
        return at < len(self.known) and self._hiding[at] < until
