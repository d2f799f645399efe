"""Findings that somebody waits for, as `-a finding:` and `--trigger` name them: `error`, `TRF-010`."""

from __future__ import annotations

import difflib
from typing import TYPE_CHECKING

from analyzer.report.model import CATEGORIES, SEVERITIES
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable

    from analyzer.report.model import Finding
    from analyzer.report.newest import Change


@dataclass(frozen=True, slots=True)
class FindingPattern:
    """Findings of at least a severity, maybe of one category, or of a rule or a layer of rules."""

    severity: str = ""
    category: str = ""
    rule: str = ""

    def matches(self, finding: Finding) -> bool:
        """Return True if that is one of them; what is excused is none."""
        if finding.excused:
            return False
        if self.rule:
            return self.rule in {finding.rule, finding.rule.partition("-")[0]}
        bad_enough = SEVERITIES.index(finding.severity) <= SEVERITIES.index(self.severity)
        return bad_enough and self.category in {"", finding.category}


def parse_pattern(option: str, text: str, rules: Collection[str]) -> FindingPattern:
    """Read `error` (at least), `protocol:error`, `TRF-010` or `TRF`, one of `rules`. Raises `ValueError`."""
    category, _, severity = text.rpartition(":")
    if severity in SEVERITIES and category in {"", *CATEGORIES}:
        return FindingPattern(severity, category)
    known = {*rules, *(rule.partition("-")[0] for rule in rules)}
    if text.upper() in known:
        return FindingPattern(rule=text.upper())
    near = difflib.get_close_matches(text.upper(), sorted(known), n=3) or difflib.get_close_matches(text, SEVERITIES)
    hint = f"did you mean {', '.join(near)}" if near else "give error, warning, note, a rule or its first letters"
    raise ValueError(f"{option} {text}: no such rule ({hint})")


def first_match(patterns: Collection[FindingPattern], changes: Iterable[Change]) -> Finding | None:
    """Return the first finding that somebody waits for."""
    return next((c.finding for c in changes if any(pattern.matches(c.finding) for pattern in patterns)), None)
