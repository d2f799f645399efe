"""Additions of a vehicle file to a report: labels, waivers, and what a capture must show."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.facts.names import short
from analyzer.facts.traffic import FEWEST_OF_RATE
from analyzer.report.model import Requirement, Waiver, WaiverUse
from analyzer.report.wording import plural
from analyzer.rules.vehicle.expected import TOLERANCE
from analyzer.rules.verdicts import UNJUDGED
from dissectors.records import replace
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence
    from datetime import date

    from analyzer.facts.summary import NodeFacts
    from analyzer.report.draft import Demand, Draft, Excuses, JudgedCapture, Revise
    from analyzer.report.model import Finding
    from analyzer.rules.vehicle.expected import Excuse, Expected


def revision(expected: Expected, today: date) -> Revise:
    """Return what labels the vehicle's nodes in place of channels, and puts waivers on the findings they cover."""
    labels = {number: node.label for number, node in expected.nodes.items() if node.label}

    def named(finding: Finding) -> Finding:
        excuse = expected.excuse(finding.rule, finding.node, finding.type, today)
        waiver = None if excuse is None else Waiver(excuse.reason, excuse.owner, excuse.expires.isoformat())
        label = finding.label if finding.node is None else labels.get(finding.node, finding.label)
        return replace(finding, label=label, waiver=waiver)

    def revise(draft: Draft) -> Draft:
        captures = tuple(
            replace(one, nodes=tuple(replace(node, label=labels.get(node.node, node.label)) for node in one.nodes))
            for one in draft.captures
        )
        events = tuple(replace(one, label=labels.get(one.node or 0, one.label)) for one in draft.events)
        return replace(draft, captures=captures, findings=tuple(map(named, draft.findings)), events=events)

    return revise


def expired(expected: Expected, today: date) -> Iterator[str]:
    """Return a line for each waiver that does not count any more."""
    for one in expected.excuses:
        if one.expires < today:
            yield (
                f"{expected.path}: the waiver of {_covered(one)} by {one.owner} expired on {one.expires.isoformat()} "
                "and does not count"
            )


def excuses(expected: Expected, today: date) -> Excuses:
    """Return what tells the use of each waiver of the file."""

    def used(findings: Iterable[Finding]) -> Iterator[WaiverUse]:
        found = list(findings)
        for one in expected.excuses:
            count = sum(one.concerns(finding.rule, finding.node, finding.type) for finding in found)
            yield WaiverUse(
                one.rule, one.node, one.type, one.reason, one.owner, one.expires.isoformat(), one.expires < today, count
            )

    return used


def demand(expected: Expected) -> Demand:
    """Return the file's requirements: types and rules for all captures together, all else for each one.

    Of a capture with nothing to judge nothing is expected, and no rate of one without times.
    """

    def requirements(draft: Draft) -> Iterator[Requirement]:
        several = len(draft.taken) > 1
        for one in draft.taken:
            for needed in () if one.unopened else _of_capture(expected, one):
                if needed.expected and not one.judgeable:
                    continue
                yield replace(needed, what=f"{needed.what} in {one.id}") if several else needed
        yield from _of_all(expected, draft)

    return requirements


def _covered(one: Excuse) -> str:
    return " ".join([one.rule, *([] if one.node is None else [f"node {one.node}"]), *([one.type] if one.type else [])])


def _of_capture(expected: Expected, one: JudgedCapture) -> Iterator[Requirement]:
    facts, wanted = one.checked.outcome.facts, expected.demand
    for node in sorted(expected.nodes):
        yield from _of_node(expected, node, one)
    escs, running = int(facts.get("escs", 0)), facts.get("running_s", 0.0)
    if expected.escs is not None:
        yield Requirement(f"{expected.escs} ESCs", escs == expected.escs, str(escs), expected=True)
    if wanted.escs is not None:
        yield Requirement(f"at least {wanted.escs} ESCs", escs >= wanted.escs, str(escs))
    if wanted.running_s is not None:
        yield Requirement(f"motors turning for {wanted.running_s:g} s", running >= wanted.running_s, f"{running:.1f} s")
    for unit, number in sorted(expected.units.items()):
        found = facts.get(f"unit {unit}")
        said = "no status of it" if found is None else f"node {found:g}"
        yield Requirement(f"power unit 0x{unit:02X} at node {number}", found == number, said, expected=True)


def _of_node(expected: Expected, number: int, one: JudgedCapture) -> Iterator[Requirement]:
    node = expected.nodes[number]
    name = f"node {number}" + (f" ({node.label})" if node.label else "")
    sent = [what for what in one.checked.facts.nodes if what.node == number]
    yield Requirement(name, bool(sent), f"{sum(what.count for what in sent)} transfers", expected=True)
    for kind, rate in node.rates.items():
        met, shown = _rate(one, [what for what in sent if what.sends == kind], rate)
        yield Requirement(f"{short(kind)} of {name} at {rate:g}/s", met, shown, expected=one.timed)


def _rate(one: JudgedCapture, sent: Sequence[NodeFacts], rate: float) -> tuple[bool, str]:
    """Return whether transfers come at a rate, and what was found of it.

    Too few for a rate of their own are counted against those that are due from the first, or from the start of the
    capture, to its end: one more or less is how the capture was cut.
    """
    rates = [what.hz for what in sent if what.hz is not None]
    if rates or not rate:
        met = any(abs(hz - rate) <= TOLERANCE * rate for hz in rates) if rates else True
        return met, " and ".join(f"{hz:.4g}/s" for hz in rates) or "no rate"
    count, facts = sum(what.count for what in sent), one.checked.facts
    if count >= FEWEST_OF_RATE or facts.start is None or facts.end is None:
        return False, "no rate"
    begun = min((what.first for what in sent if what.first is not None), default=facts.start)
    lasts = (facts.end - begun) / SECOND
    due = rate * lasts + (count > 0)
    return abs(count - due) <= 1 + TOLERANCE * due, f"{plural(count, 'transfer')} in {lasts:.3g} s"


def _of_all(expected: Expected, draft: Draft) -> Iterator[Requirement]:
    for kind in expected.demand.types:
        count = draft.coverage.types.get(kind, draft.coverage.packets.get(kind, 0)) if draft.coverage else 0
        yield Requirement(f"type {short(kind)}", count > 0, f"{count} transfers")
    rulings = {ruling.rule: ruling for ruling in draft.rules}
    for rule in expected.demand.rules:
        ruling = rulings[rule]
        found = ruling.verdict + (f" ({ruling.reason})" if ruling.reason else "")
        yield Requirement(f"rule {rule} judged", ruling.verdict not in UNJUDGED, found)
