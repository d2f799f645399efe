"""One live session: what the hub gives is recorded, decoded, judged and shown, in this order."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Protocol

from analyzer.engine import Engine
from analyzer.live import remarks
from analyzer.live.recorded import AsRecorded
from analyzer.report.newest import Newest
from analyzer.rules.checking import Check

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from analyzer._native import Piece
    from analyzer.cli.judging import Judging
    from analyzer.cli.live_keeper import Recording
    from analyzer.engine import Batch
    from analyzer.facts.summary import Stored
    from analyzer.live.hub import Hub
    from analyzer.report.newest import Change
    from analyzer.rules.checking import Checked, Measured

# Seconds between two looks at what has changed, when many findings make that expensive.
_RARE = 5.0
_MANY = 500


class View(Protocol):
    """Shows a session while it runs."""

    def batch(self, measured: Measured) -> None:
        """The next batch."""

    def found(self, changes: Sequence[Change]) -> None:
        """Findings that are new or have come up again."""

    def note(self, text: str) -> None:
        """Something about the session itself."""

    def look(self, session: LiveSession) -> None:
        """Called at least a few times a second, whether something came or not."""


class Keeper(Protocol):
    """Takes what is to be recorded."""

    def put(self, piece: Piece) -> None:
        """The next rows; it never waits."""

    def found(self, changes: Sequence[Change]) -> None:
        """Findings of rows that it has."""

    def press(self, why: str) -> None:
        """Somebody wants what is there now to be recorded."""

    def notes(self) -> Sequence[str]:
        """What has happened to it since the last call."""


class LiveSession:
    """Runs in one thread; `stop` and `mark` may be called from any, also from a signal handler.

    Args:
        hub: open by the time it runs.
        judging: rules and types.
        recording: what is recorded, and when it is enough.
        views: show it; more may be added until it runs.
        interval: seconds between two batches.
        now: seconds of a monotonic clock.
    """

    def __init__(
        self,
        hub: Hub,
        judging: Judging,
        recording: Recording,
        views: Sequence[View],
        interval: float,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self.hub = hub
        self.engine = Engine(judging.registry)
        self.check = Check(judging.registry, judging.settings)
        self.newest = Newest(self.check.judge, judging.settings, judging.revisions())
        self.frames = 0
        self.stopped = False
        self.problems: list[str] = []
        self._recorded = AsRecorded()
        self._keeper, self._autostop, self._views = recording.keeper, recording.autostop, views
        self._interval, self._now = interval, now
        self._marks = self._marked = 0
        self._looked = now()
        if recording.header:
            self._feed(self._recorded.of(remarks.comment(time.time_ns(), recording.header)))

    def stop(self) -> None:
        """The session ends soon."""
        self.stopped = True

    def mark(self) -> None:
        """Sets a mark in the recording."""
        self._marks += 1

    def run(self) -> None:
        """Until somebody stops it, a condition holds, or every interface is gone."""
        while not self.stopped:
            self.step()

    def step(self) -> None:
        """What has come since, after gathering for a moment."""
        piece = self.hub.take(self._interval)
        self.tell(*self.hub.notes())
        if piece is not None:
            self._take(piece)
            self._judge(self.engine.flush())
        else:
            self._look()
        while self._marked < self._marks:
            self._marked += 1
            self.hub.put(text := f"mark {self._marked}")
            self.tell(text)
            if self._keeper is not None:
                self._keeper.press(text)
        if self._keeper is not None:
            self.tell(*self._keeper.notes())
        for view in self._views:
            view.look(self)
        if self._autostop.due() and not self.stopped:
            self.tell(f"enough: {self._autostop.reason}")
            self.stopped = True
        self.stopped = self.stopped or self.hub.ended

    def tell(self, *texts: str) -> None:
        """Something about the session itself, for every view."""
        for text in texts:
            for view in self._views:
                view.note(text)

    def drain(self) -> None:
        """What the closed hub still has, the last of it."""
        while (piece := self.hub.take(0)) is not None:
            self._take(piece)
        self.tell(*self.hub.notes())
        self._judge(self.engine.finish())

    def conclude(self, stored: Iterable[Stored]) -> Checked:
        """Everything that the rules can only say now; `stored` are the files that were recorded."""
        checked = self.check.finish(stored, self.engine)
        self._look(last=True)
        return checked

    def _take(self, piece: Piece) -> None:
        piece = self._recorded.of(self._autostop.cut(piece))
        if self._keeper is not None:
            self._keeper.put(piece)
        self.frames += piece.frames
        self._feed(piece)

    def _feed(self, piece: Piece) -> None:
        for batch in self.engine.feed(piece):
            self._judge(batch)

    def _judge(self, batch: Batch) -> None:
        for measured in self.check.measured([batch]):
            self.check.feed(measured)
            for view in self._views:
                view.batch(measured)
        self._look()

    def _look(self, *, last: bool = False) -> None:
        """Tells of findings; when there are very many of them, more seldom."""
        now = self._now()
        if len(self.newest.all) >= _MANY and now - self._looked < _RARE and not last:
            return
        self._looked = now
        changes = self.newest.look(self.engine.buses)
        if not changes:
            return
        self._autostop.found(changes)
        if self._keeper is not None:
            self._keeper.found(changes)
        for view in self._views:
            view.found(changes)
