"""A live session as lines: transfers on standard output, findings and whatever happens on standard error."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.app.live.lag import Delay
from analyzer.facts.traffic import times
from analyzer.report import wording
from analyzer.views.terminal import escape

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from analyzer.app.live.session import LiveSession
    from analyzer.decode.engine import Batch
    from analyzer.filter.matcher import Matcher
    from analyzer.live.printer import Printer
    from analyzer.report.model import Finding
    from analyzer.report.newest import Change
    from analyzer.rules.checking import Measured
    from analyzer.views.formats import Writer
    from analyzer.views.options import WriterOptions
    from analyzer.window.listed import ListedRows
    from dissectors import Registry

# Findings that are told in one go.
_AT_ONCE = 20


class EventLines:
    """Events as lines: findings as they begin, notes of the session.

    Args:
        several: whether the names of interfaces say anything.
        say: takes text for standard error.
    """

    def __init__(self, *, several: bool, say: Callable[[str], None]) -> None:
        self.failed = False
        self._several, self._say = several, say

    def batch(self, measured: Measured) -> None:
        """Do nothing."""

    def found(self, changes: Sequence[Change]) -> None:
        """Write a line for each that is new; notes can wait for the verdict."""
        told = [change for change in changes if change.fresh and change.finding.severity != "note"]
        for change in told[:_AT_ONCE]:
            self._say(f"{said(change.finding, bus=self._several)}\n")
        if len(told) > _AT_ONCE:
            self._say(f"! and {len(told) - _AT_ONCE:,} more at once: the verdict has them all\n")

    def note(self, text: str) -> None:
        """Write a line."""
        self._say(f"-- {escape(text)}\n")

    def look(self, session: LiveSession) -> None:
        """Do nothing."""


class TransferList(EventLines):
    """The transfers, too, as `decode` shows them.

    Args:
        options: what to list.
        registry: the types.
        printer: takes the lines.
        several, say: as for `EventLines`.
        matcher: chooses rows; all are listed without one.
    """

    def __init__(
        self,
        options: WriterOptions,
        registry: Registry,
        printer: Printer,
        *,
        several: bool,
        say: Callable[[str], None],
        matcher: Matcher | None = None,
    ) -> None:
        super().__init__(several=several, say=say)
        self._matcher = matcher
        self._options, self._registry, self._printer = options, registry, printer
        self._writer: Writer | None = None
        self._delay = Delay("the list is ", "whoever reads it is slow")
        self._lost = 0
        self._failed = False

    def batch(self, measured: Measured) -> None:
        """List its transfers."""
        self._list(measured.batch)

    def _list(self, batch: Batch) -> None:
        if self._writer is None:
            if not len(batch.frames) and not len(batch.events):
                return
            self._writer = self._begun(_first_time(batch))
        for text in self._writer.rows(batch, self._rows(batch)):
            self._printer.put(text)
        if line := self._delay.line(self._printer.behind):
            self.note(line)

    def _rows(self, batch: Batch) -> ListedRows:
        from analyzer.window.listed import ListedRows  # noqa: PLC0415 - a monitor does without

        rows = ListedRows.all_of(batch)
        return rows if self._matcher is None else rows.of(self._matcher.feed(batch).selected())

    def look(self, session: LiveSession) -> None:
        """Notice a reader who has seen enough, or is too slow. To be called after the printer has ended, too."""
        printer = self._printer
        if printer.problem is not None and not self._failed:
            self._failed = True
            session.problems.append(f"standard output: {printer.problem}")
        if printer.gone or self._failed:
            session.stop()
        if printer.lost > self._lost:
            self.note(f"not listed, as whoever reads the list is too slow for it: {printer.lost - self._lost:,} more")
            self._lost = printer.lost

    def end(self, findings: Sequence[Finding]) -> None:
        """Write what stands behind everything; a form that brackets its entries does so around none of them, too."""
        del findings
        self._writer = self._writer or self._begun(None)
        self._printer.put(self._writer.end())

    def _begun(self, zero: int | None) -> Writer:
        from analyzer.views.writers import writer  # noqa: PLC0415 - a monitor does without

        made = writer(self._options, self._registry, zero)
        self._printer.put(made.begin())
        return made


def said(finding: Finding, *, bus: bool = False) -> str:
    """Write a finding in one line, with the local time of day; `bus` says that there are several."""
    when = wording.moment(finding.first.t_ns, None, utc=False)
    where = " ".join(filter(None, (wording.place(finding, bus=bus), wording.safe(finding.type))))
    frame = f" (frame {finding.first.frame})" if finding.first.frame is not None else ""
    text = wording.safe(f"{finding.title}: {finding.text}")
    return f"! {when} {finding.severity} {finding.rule} {where}: {text}{frame}"


def _first_time(batch: Batch) -> int | None:
    t, valid = times(batch.frames)
    return int(t[valid][0]) if valid.any() else None
