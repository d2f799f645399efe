"""The rows of a live session as they come: a source like any other, which one run reads."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from analyzer.sources.merge import Plan, open_captures

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from analyzer._native import FrameBatch
    from analyzer.app.live.batch_interval import BatchInterval
    from analyzer.app.live.session_recording import RecordedFile, SessionRecording
    from analyzer.app.source import RunSource
    from analyzer.live.capture_loop import CaptureLoop


class LiveSource:
    """Gives what a capture loop has recorded, or would have, until that has ended.

    Args:
        loop: receives and records.
        recording: its files can be read again, and are all that can.
        name: of the session, if nothing is recorded.
        interval: how long rows are gathered for a batch.
        look: called after each batch, once that is shown.
        now: seconds of a monotonic clock.
    """

    damage = problem = length = None
    size = 0
    waits = False

    def __init__(
        self,
        loop: CaptureLoop,
        recording: SessionRecording,
        name: str,
        interval: BatchInterval,
        look: Callable[[], None],
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self._loop, self._recording, self._interval, self._look = loop, recording, interval, look
        self._name, self._now = name, now

    @property
    def name(self) -> str:
        """The first file of the recording, else the name of the session."""
        return next(iter(self._recording.files), self._name)

    @property
    def parts(self) -> Sequence[RecordedFile]:
        """The files of the recording."""
        return self._recording.stored()

    @property
    def live(self) -> bool:
        """True if nothing is recorded that could be read again."""
        return not self._recording.files

    @property
    def stopped(self) -> bool:
        """True once the session was asked to end."""
        return self._loop.control.stopped

    @stopped.setter
    def stopped(self, value: bool) -> None:
        if value:
            self._loop.control.stop()

    def chunks(self) -> Iterator[bytes | FrameBatch]:
        """Yield rows, gathered for an interval, and an empty text behind those of each; whoever takes them is timed."""
        last = False
        while not last:
            last = self._loop.ended
            rows = self._loop.take(self._interval.seconds)
            start = self._now()
            yield from rows
            yield b""
            self._look()
            self._interval.took(self._now() - start)

    def again(self) -> RunSource:
        """Return what is recorded, to be read like any capture."""
        return open_captures(self._recording.files, Plan(same_bus=True))
