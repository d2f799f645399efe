"""One fault is one finding: a transfer that ends without its end because a frame is missing is told once."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from analyzer.rules.verdicts import Breach

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from analyzer.report.model import Finding, RuleVerdict

# What is left out, and what already says it with a cause.
FOLDED, INTO = "TRF-006", "TRF-003"


def fold(findings: Sequence[Finding]) -> tuple[tuple[Finding, ...], tuple[Finding, ...]]:
    """The findings to show, in their order, and those that others say already."""
    into = [one for one in findings if one.rule == INTO]
    folded = tuple(one for one in findings if one.rule == FOLDED and says(one, into))
    left_out = set(map(id, folded))
    return tuple(one for one in findings if id(one) not in left_out), folded


def says(finding: Finding, findings: Iterable[Finding]) -> list[Finding]:
    """The findings of `INTO` that together are about the transfers of this one and no others; none if some differ.

    Only a few transfers of a finding are known by their frames, so the number of all of them has to be the same too.
    """
    found = [one for one in findings if one.rule == INTO and _about(one) == _about(finding) and _within(one, finding)]
    frames = {example.frame for one in found for example in one.examples}
    own = {example.frame for example in finding.examples}
    same = None not in own and own <= frames and sum(one.count for one in found) == finding.count
    return found if same else []


def _about(one: Finding) -> tuple[object, ...]:
    return one.capture, one.bus, one.node, one.type, one.severity


def _within(one: Finding, other: Finding) -> bool:
    """Whether it begins and ends at frames of the other one's course."""
    places = (other.first.frame, one.first.frame, one.last.frame, other.last.frame)
    numbers = [place for place in places if place is not None]
    return len(numbers) == len(places) and numbers == sorted(numbers)


def breaches(capture: str, findings: Sequence[Finding], folded: Iterable[Finding]) -> list[Breach]:
    """Those of a capture; what is folded is excused with what says it."""
    found = [Breach(one.rule, one.severity, one.waiver is not None) for one in findings if one.capture == capture]
    for one in folded:
        into = says(one, findings) if one.capture == capture else []
        found += [Breach(one.rule, one.severity, all(other.waiver for other in into))] * bool(into)
    return found


def ruled(rule: RuleVerdict, folded: Sequence[Finding]) -> RuleVerdict:
    """The verdict says where the findings are that are not shown, and counts only the others."""
    count = sum(one.rule == rule.rule for one in folded)
    if not count:
        return rule
    reason = ", ".join(text for text in (rule.reason, f"see {INTO}") if text)
    return replace(rule, findings=rule.findings - count, reason=reason)
