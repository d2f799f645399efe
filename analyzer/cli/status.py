"""Exit statuses: what a command's end means to whoever called it is decided here and nowhere else."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.app.process import streams

if TYPE_CHECKING:
    from analyzer.app.run import Run, RunState
    from analyzer.report.comparison.model import CaptureDiff
    from analyzer.report.model import Report

OK, FINDINGS, USAGE, DAMAGED, NOT_JUDGED, INTERRUPTED = 0, 1, 2, 3, 4, 130
_OF_STATE: dict[RunState, int] = {"whole": OK, "damaged": DAMAGED, "refused": USAGE, "interrupted": INTERRUPTED}


def of_run(run: Run) -> int:
    """Return the status of a command that has read captures and shown what they hold."""
    return _OF_STATE[run.state]


def of_report(report: Report, *, complete: bool) -> int:
    """Return the status of a verdict; `complete` unless something could not be written."""
    return report.gate.exit_status or (OK if complete else DAMAGED)


def of_comparison(found: CaptureDiff, *, complete: bool) -> int:
    """Return the status of two captures compared; `complete` unless something could not be read or written."""
    if found.failed:
        return FINDINGS
    if not found.judged and not found.unopened:
        return NOT_JUDGED
    return OK if complete else DAMAGED


def usage(error: Exception | str, who: str) -> int:
    """Say why the arguments make no sense; return the status for that."""
    words = error.args[0] if isinstance(error, LookupError) else error
    place = getattr(error, "place", "")  # of a filter: it is escaped already, and has lines of its own
    streams.complain(str(words) if not place else error.args[0], who)  # type: ignore[union-attr]
    if place:
        streams.tell(f"{place}\n")
    return USAGE


def damaged(error: Exception | str, who: str = "tailbyte") -> int:
    """Say what could not be opened, read or written; return the status for that."""
    streams.complain(str(error), who)
    return DAMAGED
