"""Times without a frame of any interface."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import NO_TIME, SECOND, Occurrence, Rule

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, View

# Frames before a gap whose order may be mixed up.
_MIXED = 64


class Gaps(Rule):
    """CAP-002: a time without a frame of any interface."""

    rules = ("CAP-002",)

    def __init__(self) -> None:
        self._last: tuple[Array, list[tuple[int, int]]] = (np.empty(0, np.int64), [])

    def feed(self, view: View) -> Iterator[Occurrence]:
        """Compare each time with that of the frame before, also across batches."""
        frames = view.frames
        rows = None if (frames.t != NO_TIME).all() else np.flatnonzero(frames.t != NO_TIME)
        old = len(self._last[0])
        t = np.concatenate((self._last[0], frames.t if rows is None else frames.t[rows]))
        silence = view.number("CAP-002", "silence_s") * SECOND
        late = (np.flatnonzero(np.diff(t) > silence) + 1).tolist()

        def place(at: int) -> tuple[int, int]:
            """Return number and interface of a frame."""
            if at < old:
                return self._last[1][at]
            row = at - old if rows is None else int(rows[at - old])
            return row + frames.first, int(frames.bus[row])

        for at in late:
            if at < old:
                continue
            # A frame that came late hides an even later one before it.
            before = np.arange(max(0, at - _MIXED), at)
            before = before[t[before] <= t[at - 1] + silence]
            last = int(before[np.argmax(t[before])])
            gap = int(t[at] - t[last])
            if gap > silence:
                number, bus = place(last)
                yield Occurrence("CAP-002", int(t[last]), bus, None, "", (number,), {"seconds": gap / SECOND})
        self._last = t[-_MIXED:].copy(), [place(at) for at in range(max(0, len(t) - _MIXED), len(t))]
