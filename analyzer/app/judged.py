"""A run under all rules: who reads it gets its batches when they are judged."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.app.process.start import return_columns
from analyzer.app.process.threads import beside
from analyzer.decode.core import BATCH_ROWS
from analyzer.facts.frame_marks import MarksError, marks_beside
from analyzer.report.draft import JudgedCapture
from analyzer.rules.checking import Check
from analyzer.sources.errors import CaptureError, StopReading

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from analyzer.app.criteria import Criteria
    from analyzer.app.run import Run
    from analyzer.decode.engine import Batch
    from analyzer.facts.frame_marks import Mark
    from analyzer.facts.traffic import ForeignIds
    from analyzer.flight.verdict.model import Triage
    from analyzer.rules.checking import Measured
    from analyzer.rules.judge import Judge
    from analyzer.rules.named_frames import TakesOccurrences


class JudgedRun:
    """Judges a run by the criteria while somebody else uses its batches, by one of two ways, once.

    Args:
        run: not read yet.
        criteria: of the same types.
        named: is told which frames are named.
        foreign: counts identifiers that are not DroneCAN, for who wants to see them.
    """

    def __init__(
        self, run: Run, criteria: Criteria, named: TakesOccurrences | None = None, foreign: ForeignIds | None = None
    ) -> None:
        self.run = run
        run.engine.core.measured = True
        self._ends = not run.request.window.leaves_off
        self._check = Check(run.registry, criteria.settings_of(run.request.window), named, foreign)
        self._unopened = ""

    @property
    def judge(self) -> Judge:
        """The rules at work."""
        return self._check.judge

    def feed(self, batch: Batch) -> Iterator[Measured]:
        """Judge a batch of the run in this thread, and yield it."""
        for measured in self._check.measured([batch]):
            self._check.feed(measured)
            yield measured

    def batches(self, decoded: Iterable[Batch]) -> Iterator[Measured]:
        """Yield the batches of the run once they are judged; files are decoded ahead.

        Ctrl-C while a capture was being opened is `KeyboardInterrupt`.
        """
        parts = self.run.source.parts
        for part in parts:
            part.hashed = True
        try:
            for measured in self._check.measured(decoded):
                return_columns(faulty=len(measured.batch.frames) < BATCH_ROWS)  # else only the last one is short
                self._check.feed(measured)
                yield measured
                del measured  # else it would be there while the next one is made
        except CaptureError as error:
            self._unopened = _reason(error, parts[0].name)
            raise
        except StopReading:
            raise KeyboardInterrupt from None

    def beside(self, decoded: Iterable[Batch]) -> Iterator[Batch]:
        """Yield the batches of the run, judged in a thread beside; when the last one is through, all are judged."""
        if self.run.request.threads == 1:
            for batch in decoded:
                yield from (measured.batch for measured in self.feed(batch))
            return
        yield from (measured.batch for measured in beside(self._check.measured(decoded), self._check.feed))

    def taken(self, label: str, arguments: Iterable[str] = (), triage: Triage | None = None) -> JudgedCapture:
        """Return what a report needs of the capture, which it calls `label`, after the last batch.

        `arguments` stand behind the request's own ones where a command line reads the capture again; `triage` is what
        happened, if somebody has looked.
        """
        run = self.run
        parts = run.source.parts
        return JudgedCapture(
            id=label,
            path=parts[0].name if parts else run.source.name,
            checked=self._check.finish(parts, run.engine),
            damage=self._unopened or _damage(run),
            unopened=bool(self._unopened),
            live=run.source.live,
            ends=self._ends,
            arguments=(*run.request.again(), *arguments),
            triage=None if self._unopened else triage,
            marks=self._marks(),
        )

    def _marks(self) -> Sequence[Mark]:
        """Return the marks beside the capture; a file that is wrong is complained of."""
        captures = self.run.request.captures
        if self.run.source.live or any(not isinstance(one, str) for one in captures):
            return ()
        try:
            return marks_beside(self.run.request.names)
        except MarksError as error:
            self.run.complain(str(error))
            return ()


def _damage(run: Run) -> str:
    """Return what could not be read, after the reading."""
    found = [_reason(part.damage, part.name) for part in run.source.parts if part.damage is not None]
    lines = run.totals.lines
    if unreadable := lines.get("unreadable", 0):
        found.append(f"{unreadable} of {lines['lines']} lines or records unreadable")
    if not run.totals.balanced:
        found.append("lines and frames do not add up")
    return "; ".join(found)


def _reason(error: CaptureError, name: str) -> str:
    """Return the error without the name of the capture, which stands beside it."""
    return str(error).removeprefix(f"{name}: ")
