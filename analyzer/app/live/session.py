"""One live session: what the hub gives is recorded, decoded, shown, and judged in longer batches if that is slow."""

from __future__ import annotations

import time
from functools import partial
from typing import TYPE_CHECKING, Protocol

from analyzer.app.judged import JudgedRun
from analyzer.app.live.gathered import Gathered
from analyzer.app.live.source import LiveSource
from analyzer.app.process.mapped import return_files
from analyzer.app.process.start import end_start
from analyzer.app.request import Request
from analyzer.app.run import Run
from analyzer.app.triage import RunTriage
from analyzer.report.newest import Newest
from analyzer.rules.checking import Measured

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from analyzer.app.criteria import Criteria
    from analyzer.app.live.batch_interval import BatchInterval
    from analyzer.app.live.session_recording import SessionRecording
    from analyzer.decode.engine import Batch
    from analyzer.flight.verdict.model import Triage
    from analyzer.live.capture_loop import CaptureLoop
    from analyzer.report.draft import JudgedCapture
    from analyzer.report.newest import Change
    from analyzer.rules.named_frames import TakesOccurrences


# Seconds without a row after which findings are told that wait for more.
SILENCE = 2.0
# Batches with frames until everything that goes on with them has begun.
_AT_WORK = 25


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
        recording: what it records.
        name: of the capture, if nothing is recorded.
        criteria: rules and types.
        views: show it; more may be added until it runs.
        interval: how long rows are gathered for a batch.
        judging: how long batches that were shown are gathered until they are judged; None if they are not gathered.
        now: seconds of a monotonic clock.
        named: is told which frames rules name.
        drawn: what happened is to have time lines.
    """

    def __init__(
        self,
        loop: CaptureLoop,
        recording: SessionRecording,
        name: str,
        criteria: Criteria,
        views: list[SessionView],
        interval: BatchInterval,
        now: Callable[[], float] = time.monotonic,
        named: TakesOccurrences | None = None,
        *,
        judging: BatchInterval | None = None,
        drawn: bool = False,
    ) -> None:
        self.loop = loop
        source = LiveSource(loop, recording, name, interval, self._look, now)
        self._run = Run(Request((name,), rules=criteria.choice), registry=criteria.registry, source=source)
        self._judged: JudgedRun | None = JudgedRun(self._run, criteria, named)
        self._looked: RunTriage | None = RunTriage(self._run, drawn=drawn)
        self.newest = Newest(self._judged.judge, criteria.settings, criteria.revisions(), now=now)
        self.problems: list[str] = []
        self._views, self._recording, self._now = views, recording, now
        self._came: float | None = None  # the last row, until findings have been told that wait for more
        self._gathered = Gathered(judging, now)

    @property
    def reading(self) -> Run:
        """The run that decodes what comes."""
        return self._run

    def stop(self) -> None:
        """Ask it to end soon."""
        self.loop.control.stop()

    def mark(self) -> None:
        """Set a mark in the recording."""
        self.loop.control.mark()

    def run(self) -> None:
        """Run until the capture loop has ended and everything is judged."""
        return_files()
        heard = 0
        for batch in self._run.batches():
            self._take(batch)
            if len(batch.frames) and heard < _AT_WORK:
                heard += 1
                if heard == 1:
                    end_start()
                if heard in (1, _AT_WORK):
                    return_files()  # what the first frames alone have needed
            del batch  # else it would be there while the next one is made
        self.catch_up()

    def catch_up(self) -> None:
        """Judge what was shown and is not judged yet."""
        try:
            for batch in self._gathered.take():
                self._watch(batch)
                if self._judged is not None:
                    for _ in self._judged.feed(batch):
                        pass
                    self._tell_findings()
        except Exception as error:  # noqa: BLE001 - whatever it is, receiving and recording go on
            self._give_up(error)

    def tell(self, *texts: str) -> None:
        """Tell every view something about the session itself."""
        for text in texts:
            self._show(partial(_note, text))

    def attach(self, view: SessionView) -> None:
        """Show it in one more view."""
        self._views.append(view)

    def detach(self, view: SessionView) -> None:
        """Show it in a view no more, which may have failed meanwhile."""
        if view in self._views:
            self._views.remove(view)

    def replace(self, view: SessionView, other: SessionView, problem: str) -> None:
        """Put another view in the place of one that has failed."""
        self._views[:] = [other, *(one for one in self._views if one is not view)]
        self.problems.append(problem)
        other.note(problem)

    def conclude(self) -> JudgedCapture | None:
        """Have the rules say what they only can now; None if they failed."""
        taken = None
        if self._judged is not None:
            more = self._recording.files[1:]
            label = self._recording.name or self._run.source.name
            try:
                taken = self._judged.taken(label, (*more, "--same-bus") if more else (), self._happened())
                self._tell_findings(last=True)
            except Exception as error:  # noqa: BLE001 - the recording is there all the same
                self._give_up(error)
        return taken

    def _look(self) -> None:
        """Show what is due."""
        self.tell(*self.loop.notes())
        if self._came is not None and self._now() - self._came >= SILENCE:
            self._tell_early()
        self._show(lambda view: view.look(self))

    def _take(self, batch: Batch) -> None:
        """Show a batch; judge what was gathered when it is time."""
        if any(map(len, (batch.frames, batch.transfers, batch.events, batch.settled))):
            self._came = self._now()
            self._show(partial(_batch, Measured.of(batch)))
            if self._judged is not None:
                self._gathered.add(batch)
        if self._gathered.due:
            self.catch_up()

    def _watch(self, batch: Batch) -> None:
        """Let triage look at a batch; if it fails, only its line at the end is missing."""
        if self._looked is not None:
            try:
                self._looked.feed(batch)
            except Exception as error:  # noqa: BLE001 - receiving, judging and showing go on
                self._looked = None
                self._fail(f"triage has ended: {_said(error)}")

    def _happened(self) -> Triage | None:
        return None if self._looked is None else self._looked.found()

    def _tell_findings(self, *, last: bool = False) -> None:
        self._found(self.newest.look(self._run.engine.buses, last=last))

    def _tell_early(self) -> None:
        """Tell findings by the clock, as no frame does: the bus is silent."""
        self.catch_up()
        if self._judged is None:
            return
        try:
            changes = self.newest.look_ahead(self._run.engine.buses)
        except Exception as error:  # noqa: BLE001 - a rule that cannot be copied: its findings wait for frames
            self._came = None
            self.tell(f"findings that wait for more frames are not told in silence: {type(error).__name__}: {error}")
            return
        if changes is not None:
            self._came = None
            self._found(changes)

    def _found(self, changes: list[Change]) -> None:
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
        self._judged = None
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
