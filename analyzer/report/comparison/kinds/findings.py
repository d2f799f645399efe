"""Findings of the rules in one capture and not in the other, or much more often."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.report.comparison.matching import nodes_of
from analyzer.report.comparison.model import Difference
from analyzer.report.model import SEVERITIES
from dissectors.records import dataclass, field, replace

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.report.comparison.model import Support
    from analyzer.report.comparison.pair import Pair
    from analyzer.report.comparison.traits import MeasuredSide
    from analyzer.report.model import Finding, RuleVerdict

_SIGMAS = 3.0
_ENDS = ("CAP-005", "TRF-008")  # what a recording shows that leaves off in the middle of something
_DOUBT = "INCONCLUSIVE"
_UNPROVEN = ("NOT EXERCISED", _DOUBT)
_UNRECORDED = "not recorded"  # as reasons have it

Trouble = tuple[str, str, int | None, str]  # rule, bus and node of the second capture, type


@dataclass(slots=True)
class _Both:
    """Findings of one trouble in both captures."""

    good: list[Finding] = field(default_factory=list)
    bad: list[Finding] = field(default_factory=list)


def differences(pair: Pair) -> Iterator[Difference]:
    """Yield them. Of a node that only one capture has, what it was accused of tells nothing more."""
    found: dict[Trouble, _Both] = {}
    for finding in pair.good.report.findings:
        place = _there(pair, finding)
        if place is not None:
            found.setdefault((finding.rule, *place, finding.type), _Both()).good.append(finding)
    names = pair.bad.facts.bus_names
    alone = {(names[bus], node) for bus, node in pair.matching.added}
    for finding in pair.bad.report.findings:
        if finding.severity == "note" and (finding.bus, finding.node) in alone:
            continue
        found.setdefault((finding.rule, finding.bus, finding.node, finding.type), _Both()).bad.append(finding)
    unproven = [
        {rule.rule: rule for rule in side.report.rules if rule.verdict in _UNPROVEN} for side in (pair.good, pair.bad)
    ]
    times = _traffic(pair.bad) / max(_traffic(pair.good), 1)
    for trouble, both in found.items():
        if pair.beginning and trouble[0] in _ENDS:
            continue
        before, after = _count(both.good), _count(both.bad)
        if not before or not after:
            yield _new(pair, trouble, both, unproven[0 if after else 1])
        elif _more(pair, before, after, times):
            yield _often(pair, both, (before, after))


def compared(pair: Pair) -> int:
    """Return how many rules both captures could be judged by."""
    judged = [
        {rule.rule for rule in side.report.rules if rule.verdict not in _UNPROVEN} for side in (pair.good, pair.bad)
    ]
    return len(judged[0] & judged[1])


def _there(pair: Pair, finding: Finding) -> tuple[str, int | None] | None:
    """Return bus and node of the second capture; None for a node that it does not have."""
    names, others = pair.good.facts.bus_names, pair.bad.facts.bus_names
    if not finding.bus or finding.bus not in names:
        return finding.bus, finding.node
    bus = pair.matching.buses.get(names.index(finding.bus))
    if bus is None:
        return None
    if finding.node is None or (names.index(finding.bus), finding.node) not in nodes_of(pair.good):
        return others[bus], finding.node
    there = pair.matching.nodes.get((names.index(finding.bus), finding.node))
    return None if there is None else (others[there[0]], there[1])


def _new(pair: Pair, trouble: Trouble, both: _Both, unproven: dict[str, RuleVerdict]) -> Difference:
    some = both.bad or both.good
    head = min(some, key=lambda one: SEVERITIES.index(one.severity))
    count = _count(some)
    doubt = unproven.get(trouble[0])
    sure: Support = "possible" if doubt else "likely" if head.origin == "heuristic" else "well supported"
    reason = (doubt.reason if doubt else "") or "not exercised"
    none = (
        "none" if doubt is None or doubt.verdict != _DOUBT else _UNRECORDED if _UNRECORDED in reason else "not judged"
    )
    other = pair.good if both.bad else pair.bad
    remark = f"could not be judged in {'the first' if other is pair.good else 'the second'}: {reason}" if doubt else ""
    one = _difference(
        pair, head, some, good=_often_words(_count(both.good), none), bad=_often_words(_count(both.bad), none),
        support=sure, remark=remark, size=float(count), counts=(_count(both.good), _count(both.bad)),
        worse=bool(both.bad),
    )  # fmt: skip
    known = none == "none"
    return replace(
        one, good_value=one.good_value if both.good or known else None,
        bad_value=one.bad_value if both.bad or known else None,
    )  # fmt: skip


def _often(pair: Pair, both: _Both, counts: tuple[int, int]) -> Difference:
    before, after = counts
    head = min(both.bad, key=lambda one: SEVERITIES.index(one.severity))
    worse = after > before
    size = max(counts) / max(min(counts), 1)
    return _difference(
        pair, head, both.bad, good=_often_words(before), bad=_often_words(after),
        support=pair.support(size / 2, sum(counts), 10), remark="", size=size, counts=counts, worse=worse,
    )  # fmt: skip


def _difference(
    pair: Pair, head: Finding, some: list[Finding], *, good: str, bad: str, support: Support, remark: str,
    size: float, counts: tuple[int, int], worse: bool,
) -> Difference:  # fmt: skip
    first = min(some, key=lambda one: (one.first.t_ns is None, one.first.t_ns or 0)).first
    text = head.text if head.text and head.text != head.title else ""
    ails = head.severity != "note" and head.category != "capture"  # it is no trouble of the vehicle where a file ends
    one = Difference(
        kind="finding", weight=head.severity if worse else "note", who=head.label, bus=head.bus,
        node=head.node, what=f"{head.rule} {head.title}",
        good=good, bad=bad, support=support, size=round(size, 2), good_value=counts[0], bad_value=counts[1], unit="x",
        good_count=counts[0], bad_count=counts[1], since="first" if worse and first.t_ns is not None else "",
        t_ns=first.t_ns if worse else None, frame=first.frame if worse else None, rule=head.rule,
        remark="; ".join(filter(None, (text, remark))), eased=not worse and ails,
    )  # fmt: skip
    return pair.placed(one)


def _often_words(count: int, none: str = "none") -> str:
    return f"{count}x" if count else none


def _count(some: list[Finding]) -> int:
    return sum(one.count for one in some)


def _more(pair: Pair, before: int, after: int, times: float) -> bool:
    """Return whether counts differ by more than chance and the length of the captures explain."""
    expected = before * times
    apart = abs(after - expected)
    factor = pair.limits["finding_more"]
    much = after > factor * expected or expected > factor * after
    chance = _SIGMAS * (expected + after) ** 0.5
    return much and apart > max(chance, pair.limits["finding_counts"])


def _traffic(side: MeasuredSide) -> int:
    return side.facts.transfers
