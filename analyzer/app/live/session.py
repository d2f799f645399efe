"""One live session: what the hub gives is recorded, decoded, judged and shown, in this order."""

from __future__ import annotations

import time
from functools import partial
from typing import TYPE_CHECKING, Protocol

from analyzer.decode.engine import Engine
from analyzer.report.newest import Newest
from analyzer.rules.checking import Check

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from analyzer.app.criteria import Criteria
    from analyzer.decode.engine import Batch
    from analyzer.facts.summary import StoredCapture
    from analyzer.live.capture_loop import CaptureLoop
    from analyzer.report.newest import Change
    from analyzer.rules.checking import Checked, Measured


class SessionView(Protocol):
    """Shows a session while it runs; `failed` once it cannot."""

    failed: bool

    def batch(self, measured: Measured) -> None:
        """Take the next batch."""

    def found(self, changes: Sequence[Change]) -> None:
        """Take findings that are new or have come up again."""

    def note(self, text: str) -> None:
        """Take a note about the session itself."""

    def look(self, session: LiveSession) -> None:
        """Do what is due; called at least a few times a second, whether something came or not."""


class LiveSession:
    """Runs in one thread, which need not be the main one.

    A rule or a view that fails ends its own part, and no more: that is told, and stands in `problems`.

    Args:
        loop: receives and records.
        criteria: rules and types.
        views: show it; more may be added until it runs.
        interval: seconds between two batches.
        now: seconds of a monotonic clock.
    """

    def __init__(
        self,
        loop: CaptureLoop,
        criteria: Criteria,
        views: list[SessionView],
        interval: float,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self.loop = loop
        self.engine = Engine(criteria.registry)
        self._check: Check | None = Check(criteria.registry, criteria.settings)
        self.newest = Newest(self._check.judge, criteria.settings, criteria.revisions(), now=now)
        self.problems: list[str] = []
        self._views, self._interval = views, interval

    def stop(self) -> None:
        """Ask it to end soon."""
        self.loop.control.stop()

    def mark(self) -> None:
        """Set a mark in the recording."""
        self.loop.control.mark()

    def run(self) -> None:
        """Run until the capture loop has ended and everything is judged."""
        last = False
        while not last:
            last = self.loop.ended
            self.step()

    def step(self) -> None:
        """Decode, judge and show what has come since, after gathering for a moment."""
        for piece in self.loop.take(self._interval):
            for batch in self.engine.feed(piece):
                self._judge(batch)
        self._judge(self.engine.flush())
        self.tell(*self.loop.notes())
        self._show(lambda view: view.look(self))

    def tell(self, *texts: str) -> None:
        """Tell every view something about the session itself."""
        for text in texts:
            self._show(partial(_note, text))

    def replace(self, view: SessionView, other: SessionView, problem: str) -> None:
        """Put another view in the place of one that has failed."""
        self._views[:] = [other, *(one for one in self._views if one is not view)]
        self.problems.append(problem)
        other.note(problem)

    def conclude(self, stored: Iterable[StoredCapture]) -> Checked | None:
        """Have the rules say what they only can now; None if they failed. `stored` are the files of the recording."""
        self._judge(self.engine.finish())
        checked = None
        if self._check is not None:
            try:
                checked = self._check.finish(stored, self.engine)
                self._look(last=True)
            except Exception as error:  # noqa: BLE001 - the recording is there all the same
                self._give_up(error)
        return checked

    def _judge(self, batch: Batch) -> None:
        empty = not any(map(len, (batch.frames, batch.transfers, batch.events, batch.settled)))
        if self._check is None or empty:
            return
        try:
            for measured in self._check.measured([batch]):
                self._check.feed(measured)
                self._show(partial(_batch, measured))
            self._look()
        except Exception as error:  # noqa: BLE001 - whatever it is, receiving and recording go on
            self._give_up(error)

    def _look(self, *, last: bool = False) -> None:
        """Tell of findings."""
        changes = self.newest.look(self.engine.buses, last=last)
        if changes:
            self.loop.take_findings(changes)
            self._show(lambda view: view.found(changes))

    def _show(self, call: Callable[[SessionView], None]) -> None:
        for view in list(self._views):
            try:
                call(view)
            except Exception as error:  # noqa: BLE001 - whatever it is, everything else goes on
                self._views.remove(view)
                view.failed = True
                self._fail(f"what is shown has ended: {_said(error)}")

    def _give_up(self, error: Exception) -> None:
        self._check = None
        self._fail(f"judging has ended: {_said(error)}")

    def _fail(self, problem: str) -> None:
        self.problems.append(problem)
        self.tell(problem)


def _said(error: Exception) -> str:
    return f"{type(error).__name__}: {error}: please report this as a bug"


def _note(text: str, view: SessionView) -> None:
    view.note(text)


def _batch(measured: Measured, view: SessionView) -> None:
    view.batch(measured)
