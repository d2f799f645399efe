"""Findings while they come in: as the report would have them now, and what has changed since the last look."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

from analyzer.report import folding
from analyzer.report.draft import Draft
from analyzer.report.found import findings_from, ranked

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from analyzer.report.draft import Revise
    from analyzer.report.model import Finding, Place, Severity
    from analyzer.rules.judge import Judge
    from analyzer.rules.settings import Settings

# Times as long as a look took the next one waits.
_PATIENCE = 10


@dataclass(frozen=True, slots=True)
class Change:
    """A finding that is new, or has come up again; `fresh` says which, `more` how often since the last look."""

    finding: Finding
    fresh: bool
    more: int


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
        self._seen: dict[tuple[object, ...], dict[Severity, tuple[int, Place]]] = {}
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
        outcome = self._judge.so_far()
        shown, _ = folding.fold(
            ranked(findings_from(outcome, buses, self._judge.pages, self._settings, capture=self._capture))
        )
        draft = Draft((), (), shown)
        for revise in self._revise:
            draft = revise(draft)
        before, self._seen = self._seen, {}
        self.all = draft.findings
        found: list[Change] = []
        for one in draft.findings:
            name = one.rule, one.bus, one.node, one.type, one.key, one.first
            runs = self._seen.setdefault(name, {})
            runs[one.severity] = one.count, one.last
            then = before.get(name, {})
            if then.get(one.severity) != (one.count, one.last):
                count = then[one.severity][0] if one.severity in then else 0
                # Another severity than before makes it no new one.
                found.append(Change(one, not then, one.count - count if count or not then else 0))
        end = self._now()
        self._next = end + _PATIENCE * (end - start)
        return found
