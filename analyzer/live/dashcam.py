"""A recorder behind a trigger: to the session both are one thing that records."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from analyzer._native import Piece
    from analyzer.live.recording import Recorder
    from analyzer.live.trigger import Trigger
    from analyzer.live.wanted import Change


class Dashcam:
    """Records the windows of a trigger. The recorder is the caller's, who closes it after this.

    Args:
        recorder: open.
        trigger: says what is recorded.
        clock: monotonic nanoseconds.
    """

    def __init__(self, recorder: Recorder, trigger: Trigger, clock: Callable[[], int] = time.monotonic_ns) -> None:
        self.recorder, self._trigger, self._clock = recorder, trigger, clock
        self._came = clock()

    def put(self, piece: Piece) -> None:
        """The next rows."""
        if piece.lines["lines"] > piece.lines["comments"]:
            self._came = self._clock()
        self._record(self._trigger.feed(piece))

    def found(self, changes: Iterable[Change]) -> None:
        """Findings of rows that it has."""
        self._record(self._trigger.found(changes))

    def press(self, why: str) -> None:
        """Somebody wants what is there now to be recorded."""
        self._record(self._trigger.press(why))

    def notes(self) -> list[str]:
        """What has happened since the last call, a line each; to be called a few times a second."""
        self._record(self._trigger.tick(self._clock() - self._came))
        return self.recorder.notes()

    def close(self) -> None:
        """The session ends."""
        self._record(self._trigger.close())

    def _record(self, pieces: Iterable[Piece]) -> None:
        for piece in pieces:
            self.recorder.put(piece)
