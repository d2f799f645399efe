"""The way of rows from the hub into the recording, in a thread of its own: nothing that judges or shows holds it up."""

from __future__ import annotations

import time
from collections import deque
from contextlib import AbstractContextManager
from threading import Condition, Lock, Thread
from typing import TYPE_CHECKING, Protocol, Self

from analyzer._native import AsRecorded
from analyzer.live import remarks
from analyzer.live.frame_batches import FrameLosses, count_frames, count_rows, pick_comments
from analyzer.live.heard import HeardSenders
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence
    from types import TracebackType

    from analyzer._native import FrameBatch
    from analyzer.live.autostop import Autostop
    from analyzer.live.interfaces.hub import Hub
    from analyzer.report.newest import Change

# Rows that may wait to be judged, and that are judged in one go: 4 s of a full bus of 1 Mbit/s.
MOST, PIECE = 1 << 20, 1 << 15
# Seconds between two looks at the hub, at most.
INTERVAL = 0.1


class SessionControl:
    """The requests to a session that anybody may make at any time, also from a signal handler."""

    def __init__(self) -> None:
        self.stopped = self.hurried = False
        self.marks = self.renewals = 0

    def stop(self) -> None:
        """Ask it to end soon."""
        self.stopped = True

    def hurry(self) -> None:
        """Ask it to end soon, whether its last words are heard or not."""
        self.stopped = self.hurried = True

    def mark(self) -> None:
        """Ask for a mark in the recording."""
        self.marks += 1

    def renew(self) -> None:
        """Ask for a new file of the recording, once the one that is written was moved away."""
        self.renewals += 1


class Recorder(Protocol):
    """Takes what is to be recorded."""

    def put(self, batch: FrameBatch) -> None:
        """Take the next rows; never wait."""

    def take_findings(self, changes: Iterable[Change]) -> None:
        """Take findings of rows that it has."""

    def record_now(self, why: str) -> None:
        """Record what is there now, as somebody asks for it."""

    def begin_anew(self) -> None:
        """Begin a new file."""

    def notes(self) -> Sequence[str]:
        """Return what has happened to it since the last call."""


class CaptureLoop(AbstractContextManager["CaptureLoop"]):
    """Runs from its `with` until the control says stop, a condition holds, or every interface is gone for good.

    Then it closes the hub, takes the rest, and finishes the recording, whatever the others are doing. What has been
    recorded waits for `take`, up to `most` rows; what does not fit is not judged, counted, and told by drop counts.

    Args:
        hub: open.
        recorder: records; None if nothing is to be recorded.
        autostop: says when it is enough.
        control: says so, too.
        close: finishes the recording.
        header: a comment that stands in front of it.
        interval: seconds between two looks at the hub.
        most: rows.
        clock: nanoseconds since any moment.
    """

    def __init__(
        self,
        hub: Hub,
        recorder: Recorder | None,
        autostop: Autostop,
        control: SessionControl,
        close: Callable[[], None],
        header: str = "",
        interval: float = INTERVAL,
        most: int = MOST,
        clock: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        self.hub, self.control = hub, control
        self.ended = False
        self.frames = self.unjudged = 0
        self.problem: str | None = None
        self._recorder, self._autostop, self._close = recorder, autostop, close
        self._interval, self._most, self._enough = min(interval, INTERVAL), most, min(most // 2, PIECE)
        self._recorded = AsRecorded()
        self._recorder_lock = Lock()
        self._changed = Condition()
        self.heard = HeardSenders(clock)
        self._clock = clock
        # With the times at which they came, and the rows that count.
        self._waiting: deque[tuple[int, int, FrameBatch]] = deque()
        self._rows = self._marked = self._renewed = self._unreadable = 0
        self._losses = FrameLosses()
        self._notes: list[str] = []
        if header:
            self._pass_on(self._recorded.apply(remarks.make_comment(time.time_ns(), header)))
        self._thread = Thread(target=self._run, name="capture loop", daemon=True)

    def __enter__(self) -> Self:
        """Begin the loop."""
        self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        """End it, with everything recorded."""
        self.control.stop()
        self._thread.join()

    @property
    def left_out(self) -> dict[str, int]:
        """The rows that no recording can hold, in words, and how often."""
        own = {"what is no frame": self._unreadable} if self._unreadable else {}
        return own | self._recorded.lost

    def take(self, seconds: float) -> list[FrameBatch]:
        """Return the rows that have come, after gathering for so many seconds; the rest at once when it has ended.

        Of many that wait it returns some `PIECE`, without gathering, so that what is shown goes on.
        """
        taken: list[FrameBatch] = []
        with self._changed:
            self._changed.wait_for(lambda: self.ended or self._rows >= self._enough, seconds)
            if (drops := self._losses.take()) is not None:
                self._waiting.append((self._clock(), 0, drops))
            left = self._rows - PIECE
            while self._waiting and (self.ended or self._rows > left):
                _, rows, batch = self._waiting.popleft()
                taken.append(batch)
                self._rows -= rows
        return taken

    @property
    def behind(self) -> float:
        """Seconds since the first of the rows came that wait to be taken."""
        with self._changed:
            return (self._clock() - self._waiting[0][0]) / SECOND if self._waiting else 0.0

    def take_findings(self, changes: Sequence[Change]) -> None:
        """Take findings of rows that were taken."""
        self._autostop.take_findings(changes)
        if self._recorder is not None:
            with self._recorder_lock:
                self._recorder.take_findings(changes)

    def notes(self) -> list[str]:
        """Return the lines that are new for people."""
        with self._changed:
            notes, self._notes = self._notes, []
        return notes

    def _run(self) -> None:
        try:
            while not self.control.stopped and not self.hub.ended:
                self._step()
            self.hub.close()
            while (batch := self.hub.take(0)) is not None:
                self._move(batch)
            self._look()
        except Exception as error:  # noqa: BLE001 - the session has to hear of it, and the recording to be finished
            self.problem = f"receiving has ended: {type(error).__name__}: {error}: please report this as a bug"
        finally:
            self.control.stop()
            self._close()
            with self._changed:
                self.ended = True
                self._changed.notify_all()

    def _step(self) -> None:
        if (batch := self.hub.take(self._interval)) is not None:
            self._move(batch)
        while self._marked < self.control.marks:
            self._marked += 1
            self.hub.add_comment(text := f"mark {self._marked}")
            self._say(text)
            if self._recorder is not None:
                with self._recorder_lock:
                    self._recorder.record_now(text)
        while self._renewed < self.control.renewals:
            self._renewed += 1
            if self._recorder is not None:
                with self._recorder_lock:
                    self._recorder.begin_anew()
        self._look()
        if self._autostop.due() and not self.control.stopped:
            self._say(f"enough: {self._autostop.reason}")
            self.control.stop()

    def _look(self) -> None:
        self._say(*self.hub.notes())
        if self._recorder is not None:
            with self._recorder_lock:
                self._say(*self._recorder.notes())

    def _move(self, batch: FrameBatch) -> None:
        self._unreadable += batch.lines["unreadable"]
        batch = self._recorded.apply(self._autostop.cut(batch))
        if self._recorder is not None:
            with self._recorder_lock:
                self._recorder.put(batch)
        self.frames += batch.frames
        self.heard.feed(batch)
        self._pass_on(batch)

    def _pass_on(self, batch: FrameBatch) -> None:
        size = count_rows(batch)
        if not size:
            return
        with self._changed:
            if self._rows and self._rows + size > self._most:
                if not self.unjudged:
                    self._notes.append("judging is too slow: frames are recorded that are not judged")
                self.unjudged += count_frames(batch)
                self._losses.feed(batch)
                if (comments := pick_comments(batch)) is not None:
                    self._waiting.append((self._clock(), 0, comments))
                return
            now = self._clock()
            if (drops := self._losses.take()) is not None:
                self._waiting.append((now, 0, drops))
            self._waiting.append((now, size, batch))
            self._rows += size
            if self._rows >= self._enough:
                self._changed.notify_all()

    def _say(self, *texts: str) -> None:
        with self._changed:
            self._notes += texts
