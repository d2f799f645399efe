"""Times without a frame of any interface."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.rules.joint.gathered import Gathered, Sent
from dissectors.kit import NO_TIME, SECOND, Rule

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, Occurrences, View

# Frames before a gap whose order may be mixed up.
_MIXED = 64
_AT_ONCE = 4096


class Gaps(Rule):
    """CAP-002: a time without a frame of any interface."""

    rules = ("CAP-002",)

    def __init__(self) -> None:
        self._last: tuple[Array, list[tuple[int, int]]] = (np.empty(0, np.int64), [])
        self._found = Gathered()

    def feed(self, view: View) -> Iterator[Occurrences]:
        """Compare each time with that of the frame before, also across batches."""
        frames = view.frames
        rows = None if (frames.t != NO_TIME).all() else np.flatnonzero(frames.t != NO_TIME)
        old = len(self._last[0])
        t = np.concatenate((self._last[0], frames.t if rows is None else frames.t[rows]))
        silence = view.number("CAP-002", "silence_s") * SECOND
        late = np.flatnonzero(np.diff(t) > silence) + 1
        late = late[late >= old]

        def place(at: int) -> tuple[int, int]:
            """Return number and interface of a frame."""
            if at < old:
                return self._last[1][at]
            row = at - old if rows is None else int(rows[at - old])
            return row + frames.first, int(frames.bus[row])

        last = _latest(t, late, silence)
        for at in np.flatnonzero(t[late] - t[last] > silence).tolist():
            begin = int(t[last[at]])
            number, bus = place(int(last[at]))
            seconds = (int(t[late[at]]) - begin) / SECOND
            self._found.add("CAP-002", Sent(begin, bus), (number,), {"seconds": seconds}, drops=False)
        yield from self._found.occurrences()
        self._last = t[-_MIXED:].copy(), [place(at) for at in range(max(0, len(t) - _MIXED), len(t))]


def _latest(t: Array, late: Array, silence: float) -> Array:
    """Return of frames that came after a silence which one before each was the last: one that came late hides others.

    Where that is not the one before it, it is one of `_MIXED` that is not later than this by a silence.
    """
    found = late - 1
    for part in np.array_split(np.arange(len(late)), len(late) // _AT_ONCE + 1):
        before = late[part][:, None] - np.arange(_MIXED, 0, -1)
        times = np.where(before >= 0, t[np.maximum(before, 0)], NO_TIME)
        times[times > (t[late[part] - 1] + silence)[:, None]] = NO_TIME
        found[part] = before[np.arange(len(part)), times.argmax(axis=1)]
    return found
