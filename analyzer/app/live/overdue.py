"""Transfers that only the clock has ended: on a silent bus no later frame does. Told for people; rules go by frames."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from analyzer.board.opened import OpenTransfers
from analyzer.report import wording
from dissectors.kit import NO_TIME, FrameTable

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from analyzer.app.live.session import LiveSession
    from analyzer.report.newest import Change
    from analyzer.rules.checking import Measured

_NODE = 0x7F
_NAMED = 3


class Overdue:
    """Tells once for each silence whose transfers stay open.

    Args:
        tell: takes a line.
        clock: nanoseconds since any moment.
    """

    def __init__(self, tell: Callable[..., None], clock: Callable[[], int] = time.monotonic_ns) -> None:
        self.failed = False
        self._tell, self._clock = tell, clock
        self._opened = OpenTransfers()
        self._last, self._then = NO_TIME, 0
        self._buses: tuple[str, ...] = ()
        self._told = NO_TIME  # the frame behind which the last silence began that was told

    def batch(self, measured: Measured) -> None:
        """Look what begins and ends."""
        frames = FrameTable(measured.batch.frames)
        timed = frames.t[frames.t != NO_TIME]
        if len(timed):
            self._opened.feed(frames)
            self._last, self._then, self._buses = int(timed[-1]), self._clock(), measured.batch.buses

    def found(self, changes: Sequence[Change]) -> None:
        """Do nothing."""

    def note(self, text: str) -> None:
        """Do nothing."""

    def look(self, session: LiveSession) -> None:
        """Tell what the clock says."""
        del session
        if self._last == NO_TIME:
            return
        if self._told == self._last:
            return
        found = self._opened.overdue(self._last + self._clock() - self._then, self._last)
        if found:
            self._told = self._last
            names = [f"{self._buses[sender >> 8]} node {sender & _NODE}" for sender in sorted(found)]
            more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
            count = wording.plural(sum(found.values()), "transfer")
            self._tell(f"silence: {count} timed out, of {', '.join(names[:_NAMED])}{more}")
