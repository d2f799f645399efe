"""Findings while they come in: as the report would have them now, and what has changed since the last look."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from analyzer.report import folding
from analyzer.report.build import Draft
from analyzer.report.found import ranked, told

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.report.build import Revise
    from analyzer.report.model import Finding
    from analyzer.rules.judge import Judge
    from analyzer.rules.settings import Settings


@dataclass(frozen=True, slots=True)
class Change:
    """A finding that is new, or has come up again; `fresh` says which, `more` how often since the last look."""

    finding: Finding
    fresh: bool
    more: int


class Newest:
    """The findings of a judge at work.

    Args:
        judge: has not finished.
        settings: those of the judge.
        revise: what a vehicle file has to say, such as waivers.
        capture: the name of the capture in the findings.
    """

    def __init__(self, judge: Judge, settings: Settings, revise: Sequence[Revise] = (), capture: str = "") -> None:
        self._judge, self._settings, self._revise, self._capture = judge, settings, revise, capture
        self._seen: dict[tuple[object, ...], tuple[int, object]] = {}
        self._changes = 0
        self.all: tuple[Finding, ...] = ()

    def look(self, buses: Sequence[str]) -> list[Change]:
        """What is new, worst first, then by time; `all` has every finding then. `buses` are names by index."""
        if self._judge.changes == self._changes:
            return []
        self._changes = self._judge.changes
        outcome = self._judge.so_far()
        shown, _ = folding.fold(ranked(told(outcome, buses, self._judge.pages, self._settings, capture=self._capture)))
        draft = Draft((), (), shown)
        for revise in self._revise:
            draft = revise(draft)
        before, self._seen = self._seen, {}
        self.all = draft.findings
        found: list[Change] = []
        for one in draft.findings:
            known = (one.rule, one.severity, one.bus, one.node, one.type, one.key, one.first)
            self._seen[known] = now = (one.count, one.last)
            then = before.get(known, (0, None))
            if then != now:
                found.append(Change(one, known not in before, one.count - then[0]))
        return found
