"""Times in which nothing of any interface was recorded: what is on one side of them says nothing of the other."""

from __future__ import annotations

from bisect import bisect_right
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
    """Gaps of a capture, the latest ones: since when, until when, and whether each hides something."""

    def __init__(self) -> None:
        self.begins, self.ends = np.empty(0, np.int64), np.empty(0, np.int64)
        self.hides = np.empty(0, bool)
        self._lists: tuple[list[int], list[int]] | None = [], []  # faster for one question
        self._latest: Array = np.empty(0, np.int64)

    def feed(self, t: Array, *, calm: bool) -> int:
        """Add times; return the last one before them, the first of all if there is none.

        After a gap nothing came for longer than `GAP`. It is said to hide something where much was sent before it. A
        clock that is set back by as much begins anew, too. Among times that are `calm` there is none.
        """
        last = int(self._latest[-1]) if len(self._latest) else int(t[0])
        if not calm or abs(int(t[0]) - last) > GAP:
            self._add(t)
        latest = t if len(t) >= _BUSY else np.concatenate((self._latest, t))
        self._latest = latest[-_BUSY:].copy()
        return last

    def _add(self, t: Array) -> None:
        known = len(self._latest)
        whole = np.concatenate((self._latest, t))
        steps = whole[max(known, 1) :] - whole[max(known - 1, 0) : -1]
        at = (np.abs(steps) > GAP).nonzero()[0][-_MOST:]
        if not len(at):
            return
        apart, end = steps[at], at + max(known, 1)
        begins, ends = whole[end - 1], whole[end]
        usual = begins - whole[np.maximum(end - _BUSY, 0)]
        hides = (end >= _BUSY) & (usual <= (apart - 1) // _SILENT)  # `apart` is more than so many times as long
        back = (apart < 0).nonzero()[0]
        if len(back):  # nothing before counts any more
            anew = back.item(-1)
            begins[anew], hides[anew] = ends[anew] - 1, False
            self.begins, self.ends, self.hides = begins[anew:], ends[anew:], hides[anew:]
        else:
            self.begins = np.concatenate((self.begins, begins))[-_MOST:]
            self.ends = np.concatenate((self.ends, ends))[-_MOST:]
            self.hides = np.concatenate((self.hides, hides))[-_MOST:]
        self._lists = None

    def resumed(self, t: int, start: int) -> int:
        """Return the end of the last gap before a time, else the time at which the capture starts."""
        ends, _ = self._known()
        at = bisect_right(ends, t)
        return ends[at - 1] if at else start

    def paused(self, since: int, until: int) -> bool:
        """Return whether there is a gap somewhere between two times that hides something."""
        ends, hiding = self._known()
        at = bisect_right(ends, since)
        return at < len(ends) and hiding[at] < until

    def _known(self) -> tuple[list[int], list[int]]:
        """Return the ends, and when the first of each gap and those behind it began that hide something."""
        if self._lists is None:
            hiding = np.minimum.accumulate(np.where(self.hides, self.begins, _NEVER)[::-1])[::-1]
            self._lists = self.ends.tolist(), hiding.tolist()
        return self._lists
