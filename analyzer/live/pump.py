"""The way of rows from the hub into the recording, in a thread of its own: nothing that judges or shows holds it up."""

from __future__ import annotations

import time
from contextlib import AbstractContextManager
from threading import Condition, Lock, Thread
from typing import TYPE_CHECKING, Protocol, Self

from analyzer.live import remarks
from analyzer.live.pieces import Losses, comments_of, frames_of, rows
from analyzer.live.recorded import AsRecorded

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence
    from types import TracebackType

    from analyzer._native import Piece
    from analyzer.live.autostop import Autostop
    from analyzer.live.hub import Hub
    from analyzer.live.wanted import Change

# Rows that may wait to be judged.
MOST = 1 << 20
# Seconds between two looks at the hub, at most.
INTERVAL = 0.1


class Control:
    """What anybody may ask of a session at any time, also from a signal handler."""

    def __init__(self) -> None:
        self.stopped = False
        self.marks = 0

    def stop(self) -> None:
        """It ends soon."""
        self.stopped = True

    def mark(self) -> None:
        """A mark goes into the recording."""
        self.marks += 1


class Keeper(Protocol):
    """Takes what is to be recorded."""

    def put(self, piece: Piece) -> None:
        """The next rows; it never waits."""

    def found(self, changes: Iterable[Change]) -> None:
        """Findings of rows that it has."""

    def press(self, why: str) -> None:
        """Somebody wants what is there now to be recorded."""

    def notes(self) -> Sequence[str]:
        """What has happened to it since the last call."""


class Pump(AbstractContextManager["Pump"]):
    """Runs from its `with` until the control says stop, a condition holds, or every interface is gone for good.

    Then it closes the hub, takes the rest, and finishes the recording, whatever the others are doing. What has been
    recorded waits for `take`, up to `most` rows; what does not fit is not judged, counted, and told by drop counts.

    Args:
        hub: open.
        keeper: records; None if nothing is to be recorded.
        autostop: says when it is enough.
        control: says so, too.
        close: finishes the recording.
        header: a comment that stands in front of it.
        interval: seconds between two looks at the hub.
        most: rows.
    """

    def __init__(
        self,
        hub: Hub,
        keeper: Keeper | None,
        autostop: Autostop,
        control: Control,
        close: Callable[[], None],
        header: str = "",
        interval: float = INTERVAL,
        most: int = MOST,
    ) -> None:
        self.hub, self.control = hub, control
        self.ended = False
        self.frames = self.unjudged = 0
        self.problem: str | None = None
        self._keeper, self._autostop, self._close = keeper, autostop, close
        self._interval, self._most = min(interval, INTERVAL), most
        self._recorded = AsRecorded()
        self._keeping = Lock()
        self._changed = Condition()
        self._waiting: list[Piece] = []
        self._rows = self._marked = self._unreadable = 0
        self._losses = Losses()
        self._notes: list[str] = []
        if header:
            self._pass_on(self._recorded.of(remarks.comment(time.time_ns(), header)))
        self._thread = Thread(target=self._run, name="pump", daemon=True)

    def __enter__(self) -> Self:
        """Begins."""
        self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        """Ends, with everything recorded."""
        self.control.stop()
        self._thread.join()

    @property
    def left_out(self) -> dict[str, int]:
        """What no recording can hold, in words, and how often."""
        own = {"what is no frame": self._unreadable} if self._unreadable else {}
        return own | self._recorded.lost

    def take(self, seconds: float) -> list[Piece]:
        """What has come, after gathering for so many seconds; the rest at once when it has ended."""
        with self._changed:
            self._changed.wait_for(lambda: self.ended or self._rows >= self._most // 2, seconds)
            if (drops := self._losses.take()) is not None:
                self._waiting.append(drops)
            taken, self._waiting, self._rows = self._waiting, [], 0
        return taken

    def found(self, changes: Sequence[Change]) -> None:
        """Findings of rows that were taken."""
        self._autostop.found(changes)
        if self._keeper is not None:
            with self._keeping:
                self._keeper.found(changes)

    def notes(self) -> list[str]:
        """What is new for people, a line each."""
        with self._changed:
            notes, self._notes = self._notes, []
        return notes

    def _run(self) -> None:
        try:
            while not self.control.stopped and not self.hub.ended:
                self._step()
            self.hub.close()
            while (piece := self.hub.take(0)) is not None:
                self._move(piece)
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
        if (piece := self.hub.take(self._interval)) is not None:
            self._move(piece)
        while self._marked < self.control.marks:
            self._marked += 1
            self.hub.put(text := f"mark {self._marked}")
            self._say(text)
            if self._keeper is not None:
                with self._keeping:
                    self._keeper.press(text)
        self._look()
        if self._autostop.due() and not self.control.stopped:
            self._say(f"enough: {self._autostop.reason}")
            self.control.stop()

    def _look(self) -> None:
        self._say(*self.hub.notes())
        if self._keeper is not None:
            with self._keeping:
                self._say(*self._keeper.notes())

    def _move(self, piece: Piece) -> None:
        self._unreadable += piece.lines["unreadable"]
        piece = self._recorded.of(self._autostop.cut(piece))
        if self._keeper is not None:
            with self._keeping:
                self._keeper.put(piece)
        self.frames += piece.frames
        self._pass_on(piece)

    def _pass_on(self, piece: Piece) -> None:
        size = rows(piece)
        if not size:
            return
        with self._changed:
            if self._rows and self._rows + size > self._most:
                if not self.unjudged:
                    self._notes.append("judging is too slow: frames are recorded that are not judged")
                self.unjudged += frames_of(piece)
                self._losses.add(piece)
                if (comments := comments_of(piece)) is not None:
                    self._waiting.append(comments)
                return
            if (drops := self._losses.take()) is not None:
                self._waiting.append(drops)
            self._waiting.append(piece)
            self._rows += size
            if self._rows >= self._most // 2:
                self._changed.notify_all()

    def _say(self, *texts: str) -> None:
        with self._changed:
            self._notes += texts
