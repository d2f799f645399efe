"""Findings while they come in: as the report would have them now, and what has changed since the last look."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from analyzer.report import folding
from analyzer.report.draft import Draft
from analyzer.report.found import findings_from, ranked
from analyzer.rules.runs import PAUSE
from dissectors.records import dataclass, replace

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from analyzer.report.draft import Revise
    from analyzer.report.model import Finding, Place, Severity
    from analyzer.rules.judge import Judge, Outcome
    from analyzer.rules.settings import Settings

    _Seen = dict[tuple[object, ...], dict[Severity, tuple[int, Place]]]

# Times as long as a look took the next one waits.
_PATIENCE = 10


@dataclass(frozen=True, slots=True)
class Change:
    """A finding that is new, or has come up again; `fresh` says which, `more` how often since the last look.

    What has come up since then is not before `since` (ns); None is the time of the last that was found.
    """

    finding: Finding
    fresh: bool
    more: int
    since: int | None = None


class Newest:
    """The findings of a judge at work.

    A look costs the more, the more findings there are: the next one waits ten times as long as it took.

    Args:
        judge: has not finished.
        settings: those of the judge.
        revise: what a vehicle file has to say, such as waivers.
        capture: the name of the capture in the findings.
        now: seconds of a monotonic clock.
    """

    def __init__(
        self,
        judge: Judge,
        settings: Settings,
        revise: Sequence[Revise] = (),
        capture: str = "",
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self._judge, self._settings, self._revise, self._capture = judge, settings, revise, capture
        self._now = now
        self._seen: _Seen = {}
        self._early: _Seen = {}  # what a look ahead has told
        self._changes = 0
        self._next = 0.0
        self.all: tuple[Finding, ...] = ()

    def look(self, buses: Sequence[str], *, last: bool = False) -> list[Change]:
        """Return what is new, worst first, then by time; `all` has every finding then.

        `buses` are names by index; the `last` look comes in any case.
        """
        start = self._now()
        if self._judge.changes == self._changes or (start < self._next and not last):
            return []
        self._changes = self._judge.changes
        self.all = self._findings(self._judge.so_far(), buses)
        found, self._seen = _changes(self.all, {**self._seen, **self._early})
        self._early = {name: runs for name, runs in self._early.items() if name not in self._seen}
        self._wait(start)
        return found

    def look_ahead(self, buses: Sequence[str]) -> list[Change] | None:
        """Return what would be new if nothing more came; None if it is too early for another look.

        It is provisional: what comes may explain it. Notes can wait, and what is said of the end of a capture is not
        true of one that goes on.
        """
        start = self._now()
        if start < self._next:
            return None
        outcome = self._judge.as_ended()
        pages = self._judge.pages
        runs = tuple(
            (key, run) for key, run in outcome.runs if key.severity != "note" and pages[key.rule].category != "capture"
        )
        findings = self._findings(replace(outcome, runs=runs), buses)
        found, self._early = _changes(findings, {**self._seen, **self._early})
        self._wait(start)
        return found

    def _findings(self, outcome: Outcome, buses: Sequence[str]) -> tuple[Finding, ...]:
        shown, _ = folding.fold(
            ranked(findings_from(outcome, buses, self._judge.pages, self._settings, capture=self._capture))
        )
        draft = Draft((), (), shown)
        for revise in self._revise:
            draft = revise(draft)
        return tuple(draft.findings)

    def _wait(self, start: float) -> None:
        end = self._now()
        self._next = end + _PATIENCE * (end - start)


def _changes(findings: Iterable[Finding], before: _Seen) -> tuple[list[Change], _Seen]:
    """Return what differs from what has been seen before, and what has been seen now."""
    found: list[Change] = []
    seen: _Seen = {}
    for one in findings:
        name = one.rule, one.bus, one.node, one.type, one.key, one.first
        seen.setdefault(name, {})[one.severity] = one.count, one.last
        then = before.get(name, {})
        if then.get(one.severity) == (one.count, one.last):
            continue
        if not then:
            found.append(Change(one, fresh=True, more=one.count, since=one.first.t_ns))
            continue
        # Another severity than before makes it no new one.
        count, last = then.get(one.severity, (one.count, one.last))
        found.append(Change(one, fresh=False, more=one.count - count, since=_since(one, one.count - count, last.t_ns)))
    return found, seen


def _since(finding: Finding, more: int, last: int | None) -> int | None:
    """Return the time behind which all that is new lies: its occurrences follow each other without a pause."""
    now = finding.last.t_ns
    return now if now is None or last is None else max(last, now - max(0, more - 1) * PAUSE)
