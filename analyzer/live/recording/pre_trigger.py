"""A recorder behind a trigger: to the session both are one thing that records."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from analyzer._native import FrameBatch
    from analyzer.live.recording.file_recorder import FileRecorder
    from analyzer.live.recording.trigger import Trigger
    from analyzer.report.newest import Change


class PreTriggerRecorder:
    """Records the windows of a trigger. The recorder is the caller's, who closes it after this.

    Args:
        recorder: open.
        trigger: says what is recorded.
        clock: monotonic nanoseconds.
    """

    def __init__(self, recorder: FileRecorder, trigger: Trigger, clock: Callable[[], int] = time.monotonic_ns) -> None:
        self.recorder, self._trigger, self._clock = recorder, trigger, clock
        self._came = clock()

    def put(self, batch: FrameBatch) -> None:
        """Take the next rows."""
        if batch.lines["lines"] > batch.lines["comments"]:
            self._came = self._clock()
        self._record(self._trigger.feed(batch))

    def take_findings(self, changes: Iterable[Change]) -> None:
        """Take findings of rows that it has."""
        self._record(self._trigger.take_findings(changes))

    def record_now(self, why: str) -> None:
        """Record what is there now, as somebody asks for it."""
        self._record(self._trigger.record_now(why))

    def begin_anew(self) -> None:
        """Begin a new file."""
        self.recorder.begin_anew()

    def notes(self) -> list[str]:
        """Return what has happened since the last call, a line each; to be called a few times a second."""
        self._record(self._trigger.tick(self._clock() - self._came))
        return [*self._trigger.notes(), *self.recorder.notes()]

    def close(self) -> None:
        """End the windows with the session."""
        self._record(self._trigger.finish())

    def _record(self, batches: Iterable[FrameBatch]) -> None:
        for batch in batches:
            self.recorder.put(batch)
