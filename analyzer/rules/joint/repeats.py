"""Frames that were there before: a piece of a capture that comes again is a tool's or an attacker's, and no loss."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from analyzer._native import repeats
from analyzer.decode.sent import cells
from analyzer.rules.joint.alike import identities
from analyzer.rules.joint.lack_rows import UNASKED
from dissectors.kit import SECOND

if TYPE_CHECKING:
    from analyzer.rules.joint.lack_rows import LackRows
    from dissectors.kit import Array, FrameTable

LOOK = 1 << 15  # frames before one among which it may have been before
_HELD = 1 << 17  # frames before the newest batch at least; what is older is not looked for
_NEAR = SECOND  # so far apart is what the same piece of a capture does to sessions
_FEW = 8  # frames in a row may have the same bytes before the tail: an uptime, for one
_NEW, _ONCE = 0, 2  # what a frame is, as the core says
_WIDTH = 2  # bits of that


class Repeats:
    """The last frames of all buses."""

    def __init__(self) -> None:
        self._batches: deque[FrameTable] = deque()
        self._held = 0

    def feed(self, frames: FrameTable) -> None:
        """Add the newest batch."""
        if not len(frames):
            return
        self._batches.append(frames.bare)
        self._held += len(frames)
        while self._held - len(self._batches[0]) - len(frames) >= _HELD:
            self._held -= len(self._batches.popleft())

    def among(self, lacks: LackRows, rows: Array) -> Array:
        """Return a mask of those rows where nothing is missing: frames came again or went on behind those.

        Bytes that come by themselves each time an ID comes round show that only beside others. One session is enough
        if no other one shows new bytes. What is found out of a row is kept in it: it is asked for again and again.
        """
        self._note(lacks, rows)
        seen, found = lacks.seen[rows], np.zeros(len(rows), bool)
        kind, behind = seen & (1 << _WIDTH) - 1, seen >> _WIDTH
        if not kind.any():
            return found
        until = lacks.until[rows]
        order = np.argsort(until, kind="stable")
        times = until[order]
        old = np.flatnonzero(kind != _NEW)
        first = np.searchsorted(times, until[old] - _NEAR)
        last = np.searchsorted(times, until[old] + _NEAR, "right")
        once = np.flatnonzero(kind[order] == _ONCE)
        of = lacks.session[rows[order[once]]]
        other = np.maximum.accumulate(np.where(np.diff(of, prepend=-1) != 0, np.arange(len(of)), 0))
        begin, end = np.searchsorted(once, first), np.searchsorted(once, last)
        fresh = np.append(0, np.cumsum(behind[order] == _NEW))
        some = np.flatnonzero(begin < end)
        several = other[end[some] - 1] > begin[some]
        found[old[some]] = several | (fresh[first[some]] == fresh[last[some]])
        return found

    def _note(self, lacks: LackRows, rows: Array) -> None:
        """Note what rows are by the frames around them, and what the frame behind each is."""
        rows = rows[lacks.seen[rows] == UNASKED]
        if not len(rows):
            return
        behind, left = lacks.behind[rows], lacks.left[rows]
        around = np.stack((lacks.number[rows], behind, np.where(left < 0, behind, left)))
        numbers, which = np.unique(around, return_inverse=True)
        kinds = self._asked(numbers)[which.reshape(around.shape)]
        lacks.seen[rows] = kinds.max(axis=0) | kinds[1] << _WIDTH

    def _asked(self, numbers: Array) -> Array:
        """Return what frames are, whose numbers are in order."""
        low = int(numbers[0]) - LOOK
        held = [one for one in self._batches if one.first <= numbers[-1] and one.first + len(one) > low]
        places = numbers - held[0].first if held else numbers
        return cells(repeats([identities(frames) for frames in held], places, LOOK, _FEW), np.uint8)
