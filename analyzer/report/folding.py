"""One fault is one finding: what is told with its cause, or by a rule that knows the type, is not told again."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, cast

from analyzer.report.found import ranked
from analyzer.report.model import SEVERITIES
from analyzer.rules.verdicts import RatedFinding
from dissectors.records import replace
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from analyzer.report.model import Example, Finding, RuleVerdict
    from analyzer.rules.verdicts import Excused

# What is left out, and what already says it with a cause.
INTO = {"TRF-006": ("TRF-003",), "TRF-016": ("TRF-005",), "BUS-035": ("BUS-007", "BUS-025")}
_SAYING = {rule for rules in INTO.values() for rule in rules}
_CONCERNED = INTO.keys() | _SAYING
_GAP, _STOPPED = "TRF-016", "BUS-035"
# A node that falls silent sent the type that the other rule is about so long before at most, in ns.
_BEFORE = 3 * SECOND
# A transfer without its start has no place in the count of IDs; its ID is the one that is missing there.
_ONE_MISSING = re.compile(r"expected (\d+), got \d+: 1 missing")
_WITHOUT_START = re.compile(r"transfer ID (\d+),")


def fold(findings: Sequence[Finding]) -> tuple[tuple[Finding, ...], tuple[Finding, ...]]:
    """Return the findings to show, in their order, and those that others say already."""
    index = Index(findings)
    folded = tuple(one for one in findings if one.rule in INTO and says(one, index))
    left_out = set(map(id, folded))
    return tuple(one for one in findings if id(one) not in left_out), folded


class Folds:
    """Folds findings again and again while more come in: only those of nodes where one is another object now."""

    def __init__(self) -> None:
        # Those of a node that are concerned, the identities of these, and of those that are left out.
        self._nodes: dict[tuple[object, ...], tuple[list[Finding], list[int], set[int]]] = {}

    def shown(self, findings: Sequence[Finding]) -> Sequence[Finding]:
        """Return the findings to show, in their order."""
        nodes: dict[tuple[object, ...], list[Finding]] = {}
        for one in findings:
            if one.rule in _CONCERNED:
                nodes.setdefault((one.capture, one.bus, one.node), []).append(one)
        before, self._nodes = self._nodes, {}
        left_out: set[int] = set()
        for node, own in nodes.items():
            known, names = before.get(node), list(map(id, own))
            if known is None or known[1] != names:
                known = own, names, set(map(id, fold(ranked(own))[1]))
            self._nodes[node] = known
            left_out |= known[2]
        return [one for one in findings if id(one) not in left_out] if left_out else findings


class Index:
    """The findings that others may be folded into, by what they are about."""

    def __init__(self, findings: Iterable[Finding]) -> None:
        self._found: dict[tuple[object, ...], list[Finding]] = {}
        for one in findings:
            if one.rule in _SAYING:
                for about in {_about(one), _about(one)[:-1]}:
                    self._found.setdefault((one.rule, *about), []).append(one)

    def of(self, finding: Finding) -> Sequence[Finding]:
        """Return those that may say the same as this one."""
        about = _about(finding) if finding.type else _about(finding)[:-1]
        return [one for rule in INTO.get(finding.rule, ()) for one in self._found.get((rule, *about), ())]


def says(finding: Finding, index: Index) -> list[Finding]:
    """Return the findings that together are about the transfers of this one; none if it has more to tell.

    Only a few transfers of a finding are known by their frames, so the number of all of them has to be the same too.
    """
    found = index.of(finding)
    if finding.rule == _STOPPED:
        return _silence_says(finding, found)
    return _gap_says(finding, found) if finding.rule == _GAP else _cut_says(finding, found)


def _silence_says(finding: Finding, others: Sequence[Finding]) -> list[Finding]:
    """Return those about the same breaks: of its type, or as severe ones shortly before its node fell silent."""
    found: dict[int, Finding] = {}
    for example in finding.examples:
        said = [one for one in others if any(_begins(finding, example, other) for other in one.examples)]
        if not finding.type:
            said = [one for one in said if SEVERITIES.index(one.severity) <= SEVERITIES.index(finding.severity)]
        if not said:
            return []
        found[id(said[-1])] = said[-1]
    return list(found.values())


def _begins(finding: Finding, silence: Example, other: Example) -> bool:
    """Return whether another break begins with a silence."""
    if finding.type:
        return other.frame is not None and other.frame == silence.frame
    return None not in (silence.t_ns, other.t_ns) and 0 <= (silence.t_ns or 0) - (other.t_ns or 0) <= _BEFORE


def _cut_says(finding: Finding, others: Sequence[Finding]) -> list[Finding]:
    """Return those about the same transfers alone: as severe as it, else those that somebody made more or less so."""
    near = [one for one in others if _within(one, finding)]
    as_severe = [one for one in near if one.severity == finding.severity]
    return next((found for found in (as_severe, near) if _same(finding, found)), [])


def _same(finding: Finding, found: Sequence[Finding]) -> bool:
    frames = {example.frame for one in found for example in one.examples}
    own = {example.frame for example in finding.examples}
    return None not in own and own <= frames and sum(one.count for one in found) == finding.count


def _gap_says(finding: Finding, others: Iterable[Finding]) -> list[Finding]:
    """Return those about the one transfer missing at each gap; other transfers may lack their start too."""
    cut = [(example.frame or 0, _number(_WITHOUT_START, example), one) for one in others for example in one.examples]
    found: dict[int, Finding] = {}
    before = -1
    for example in finding.examples:
        gap, missing = example.frame or 0, _number(_ONE_MISSING, example)
        said = [one for frame, number, one in cut if before < frame < gap and number == missing is not None]
        if not said:
            return []
        found[id(said[-1])] = said[-1]
        before = gap
    enough = finding.count == len(finding.examples) or finding.count == sum(one.count for one in found.values())
    return list(found.values()) if enough else []


def _number(pattern: re.Pattern[str], example: Example) -> int | None:
    found = pattern.match(example.text)
    return None if found is None else int(found.group(1))


def _about(one: Finding) -> tuple[object, ...]:
    return one.capture, one.bus, one.node, one.type


def _within(one: Finding, other: Finding) -> bool:
    """Return True if it begins and ends at frames of the other one's course."""
    places = (other.first.frame, one.first.frame, one.last.frame, other.last.frame)
    numbers = [place for place in places if place is not None]
    return len(numbers) == len(places) and numbers == sorted(numbers)


def breaches(capture: str, findings: Sequence[Finding], folded: Iterable[Finding]) -> list[RatedFinding]:
    """Return those of a capture; what is folded is excused with what says it, and no more severe."""
    found = [RatedFinding(one.rule, one.severity, one.excused) for one in findings if one.capture == capture]
    index = Index(findings)
    for one in folded:
        into = says(one, index) if one.capture == capture else []
        if into:
            excuses = {other.excused for other in into}
            excused = "" if "" in excuses else "known" if "known" in excuses else "waived"
            worst = min((other.severity for other in into), key=SEVERITIES.index)
            severity = max(worst, one.severity, key=SEVERITIES.index)
            found.append(RatedFinding(one.rule, severity, cast("Excused", excused)))
    return found


def ruled(rule: RuleVerdict, folded: Sequence[Finding]) -> RuleVerdict:
    """Say in the verdict where the findings are that are not shown, and count only the others."""
    count = sum(one.rule == rule.rule for one in folded)
    if not count:
        return rule
    reason = ", ".join(text for text in (rule.reason, f"see {', '.join(INTO[rule.rule])}") if text)
    return replace(rule, findings=rule.findings - count, reason=reason)
