"""Times without a frame of any interface."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.facts.identifiers import NOBODY
from dissectors.kit import NO_TIME, SECOND, Occurrences, Rule, times_by_bus

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, FrameTable, View

# Frames before a gap whose order may be mixed up.
_MIXED = 64
_AT_ONCE = 4096


class Gaps(Rule):
    """CAP-002: a time without a frame of any interface."""

    rules = ("CAP-002",)

    def __init__(self) -> None:
        self._last = np.empty((3, 0), np.int64)  # times, numbers and interfaces of the last frames

    def feed(self, view: View) -> Iterator[Occurrences]:
        """Compare each time with that of the frame before, also across batches."""
        frames = view.frames
        silence = view.number("CAP-002", "silence_s") * SECOND
        rows = None if (frames.t != NO_TIME).all() else np.flatnonzero(frames.t != NO_TIME)
        old = self._last.shape[1]
        t = np.concatenate((self._last[0], frames.t if rows is None else frames.t[rows]))

        def sent(places: Array) -> Array:
            """Return times, numbers and interfaces of frames by their places in `t`."""
            found = np.empty((3, len(places)), np.int64)
            here = places >= old
            row = places[here] - old if rows is None else rows[places[here] - old]
            found[:, ~here] = self._last[:, places[~here]]
            found[:, here] = frames.t[row], row + frames.first, frames.bus[row]
            return found

        if not _calm(frames, t[max(old - 1, 0) : old + 1], silence):
            late = np.flatnonzero(np.diff(t) > silence) + 1
            late = late[late >= old]
            last = _latest(t, late, silence)
            far = t[late] - t[last] > silence
            yield _occurrences(sent(last[far]), (t[late] - t[last])[far])
        self._last = sent(np.arange(max(0, len(t) - _MIXED), len(t)))


def _calm(frames: FrameTable, border: Array, silence: float) -> bool:
    """Return whether it is plain that there is no silence, neither in a batch nor at its `border` with the last one."""
    times = times_by_bus(frames)
    return len(times) == 1 and times[0].longest <= silence and bool((np.diff(border) <= silence).all())


def _occurrences(sent: Array, silence: Array) -> Occurrences:
    """Return silences of so many ns behind frames that were `sent`: their times, numbers and interfaces."""
    t, number, bus = sent
    nobody = np.full(len(t), NOBODY)
    return Occurrences(
        rule="CAP-002", t=t, bus=bus, node=nobody, type=nobody, frame=number,
        values=lambda k: {"seconds": silence.item(k) / SECOND}, frames=lambda k: (number.item(k),),
    )  # fmt: skip


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
