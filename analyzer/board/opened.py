"""Transfers that began and did not end: on a silent bus no later frame closes them, but a clock can."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.board.groups import Groups
from analyzer.tables import ERROR, EXTENDED, REMOTE, TAIL_ID, TAIL_START, VERDICTS
from dissectors.kit import NO_TIME, SECOND

if TYPE_CHECKING:
    from dissectors.kit import FrameTable

TIMEOUT = 2 * SECOND  # from the first frame on
_MOST_OPEN = 4096
_SOURCE = 0x7F
_USED = VERDICTS.index("used")


class OpenTransfers:
    """The last start or end that each session's transfer IDs had; the first `_MOST_OPEN` that are open."""

    def __init__(self) -> None:
        self._since: dict[int, int] = {}

    def feed(self, frames: FrameTable) -> None:
        """Take the frames of a batch."""
        offsets, data = frames.raw
        wire = np.frombuffer(data, np.uint8)
        plain = (frames.flags & (EXTENDED | REMOTE | ERROR)) == EXTENDED
        rows = np.flatnonzero(plain & (frames.verdict == _USED) & (frames.length > 0) & (frames.t != NO_TIME))
        if not len(rows):
            return
        tails = wire[offsets[1:][rows] - 1]
        edges = np.flatnonzero(((tails ^ (tails << 1)) & TAIL_START) != 0)  # the first or the last of several
        rows, tails = rows[edges], tails[edges]
        if not len(rows):
            return
        session = frames.bus[rows].astype(np.int64) << 29 | frames.id[rows]
        groups = Groups(session << 5 | (tails & TAIL_ID))
        begun = groups.last(tails) & TAIL_START
        since = groups.last(frames.t[rows])
        for key, begins, t in zip(groups.keys, begun.tolist(), since.tolist(), strict=True):
            if not begins:
                self._since.pop(key, None)
            elif key in self._since or len(self._since) < _MOST_OPEN:
                self._since[key] = t

    def overdue(self, now: int, last: int) -> dict[int, int]:
        """Count those that have timed out by the clock alone, by bus << 8 | node; `last` is the last frame's time.

        What the frames themselves have closed is forgotten.
        """
        self._since = {key: t for key, t in self._since.items() if last - t <= TIMEOUT}
        found: dict[int, int] = {}
        for key, t in self._since.items():
            if now - t > TIMEOUT:
                sender = key >> 34 << 8 | (key >> 5 & _SOURCE)
                found[sender] = found.get(sender, 0) + 1
        return found
