"""Times without a frame of any interface."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer import _native
from analyzer.decode.sent import cells
from analyzer.facts.identifiers import NOBODY
from dissectors.kit import NO_TIME, SECOND, Occurrences, Rule, times_by_bus

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, FrameTable, View

# Frames before a gap whose order may be mixed up.
_MIXED = 64


class Gaps(Rule):
    """CAP-002: a time without a frame of any interface."""

    rules = ("CAP-002",)

    def __init__(self) -> None:
        self._last = np.empty((3, 0), np.int64)  # times, numbers and interfaces of the last frames

    def feed(self, view: View) -> Iterator[Occurrences]:
        """Compare each time with that of the frame before, also across batches."""
        frames = view.frames
        silence = view.number("CAP-002", "silence_s") * SECOND
        if self._is_calm(frames, silence):
            (one,) = times_by_bus(frames)
            last = np.arange(len(one.t) - _MIXED, len(one.t)) if one.rows is None else one.rows[-_MIXED:]
            self._last = np.stack((frames.t[last], last + frames.first, frames.bus[last]))
            return
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

        late = (np.diff(t) > silence).nonzero()[0] + 1
        late = late[late >= old]
        # One that came late hides others.
        last = cells(_native.last_before(t, late, silence, _MIXED), np.int64)
        far = t[late] - t[last] > silence
        yield _occurrences(sent(last[far]), (t[late] - t[last])[far])
        self._last = sent(np.arange(max(0, len(t) - _MIXED), len(t)))

    def _is_calm(self, frames: FrameTable, silence: float) -> bool:
        """Return whether it is plain that there is no silence, neither in a batch nor in front of it."""
        times = times_by_bus(frames)
        if len(times) != 1 or len(times[0].t) < _MIXED or times[0].longest > silence:
            return False
        return not self._last.size or times[0].t.item(0) - self._last.item(0, -1) <= silence


def _occurrences(sent: Array, silence: Array) -> Occurrences:
    """Return silences of so many ns behind frames that were `sent`: their times, numbers and interfaces."""
    t, number, bus = sent
    nobody = np.full(len(t), NOBODY)
    return Occurrences(
        rule="CAP-002", t=t, bus=bus, node=nobody, type=nobody, frame=number,
        values=lambda k: {"seconds": silence.item(k) / SECOND}, frames=lambda k: (number.item(k),),
    )  # fmt: skip
