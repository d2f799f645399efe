"""Transfers that only the clock has ended: on a silent bus no later frame does. Told for people; rules go by frames."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from analyzer.board.opened import TIMEOUT, Opened
from analyzer.report import wording
from analyzer.rules.columns import Frames
from dissectors.conformance import NO_TIME, SECOND

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from analyzer.cli.live_session import LiveSession
    from analyzer.report.newest import Change
    from analyzer.rules.checking import Measured


class Overdue:
    """Tells of each node whose transfers stay open while nothing comes any more.

    Args:
        tell: takes a line.
        clock: nanoseconds since any moment.
    """

    def __init__(self, tell: Callable[..., None], clock: Callable[[], int] = time.monotonic_ns) -> None:
        self._tell, self._clock = tell, clock
        self._opened = Opened()
        self._last, self._then = NO_TIME, 0
        self._buses: tuple[str, ...] = ()
        self._told: dict[int, int] = {}

    def batch(self, measured: Measured) -> None:
        """Looks what begins and ends."""
        frames = Frames(measured.batch.frames)
        timed = frames.t[frames.t != NO_TIME]
        if len(timed):
            self._opened.add(frames)
            self._last, self._then, self._buses = int(timed[-1]), self._clock(), measured.batch.buses

    def found(self, changes: Sequence[Change]) -> None:
        """Nothing."""

    def note(self, text: str) -> None:
        """Nothing."""

    def look(self, session: LiveSession) -> None:
        """Tells what the clock says."""
        del session
        if self._last == NO_TIME:
            return
        found = self._opened.overdue(self._last + self._clock() - self._then, self._last)
        for sender, count in found.items():
            if count > self._told.get(sender, 0):
                open_ = f"{wording.plural(count, 'transfer')} open for more than {TIMEOUT // SECOND} s"
                self._tell(f"{self._buses[sender >> 8]}: node {sender & 0x7F}: {open_} on a silent bus: timed out")
        self._told = found
