"""From what the rules found in each capture to one report: findings with names, verdicts, coverage, the gate."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

from analyzer.report import folding
from analyzer.report.captures import describe_capture
from analyzer.report.draft import Draft
from analyzer.report.explain import needs
from analyzer.report.found import FindingMaker, events_from, ranked
from analyzer.report.model import Coverage, Gate, MarkedPlace, Place, Report, RuleVerdict
from analyzer.rules import verdicts
from analyzer.rules.exercised import coverage
from analyzer.rules.gate import passage
from dissectors.records import replace

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from analyzer.report.draft import JudgedCapture, ReportOptions
    from analyzer.report.model import Category, DeviceEvent, Finding, Origin, Requirement, Severity
    from analyzer.rules.catalogue import Page
    from analyzer.rules.gate import FailOn
    from analyzer.rules.settings import Settings
    from analyzer.rules.verdicts import Ruling
    from dissectors import Registry

_UNRECORDED = {"CAP-002", "CAP-006"}  # what was sent meanwhile is not recorded


def build(
    taken: Sequence[JudgedCapture],
    registry: Registry,
    pages: Mapping[str, Page],
    settings: Settings,
    options: ReportOptions,
) -> Report:
    """Build the report of all captures, judged with the same settings."""
    enabled = settings.enabled(pages)
    captures = tuple(describe_capture(one, registry, pages, settings) for one in taken)
    found = [finding for one in taken for finding in _findings(one, pages, settings, options.fail_on)]
    shown, folded = folding.fold(ranked(found))
    events = tuple(event for one in taken for event in _events(one, pages))
    draft = Draft(tuple(taken), captures, shown, events=events)
    for revise in options.revise:
        draft = revise(draft)
    findings = tuple(_gated(finding, options.fail_on) for finding in draft.findings)
    rulings = verdicts.rulings(pages, enabled, [_session(one, findings, folded, settings) for one in taken])
    rules = tuple(folding.ruled(_rule(rule, pages[rule], ruling, settings), folded) for rule, ruling in rulings.items())
    seen = coverage.added([one.checked.seen for one in taken])
    covered = Coverage(
        dict(seen.types), dict(seen.packets), {name: dict(values) for name, values in seen.values.items()},
        coverage.clauses(pages, rulings), coverage.never(registry),
    )  # fmt: skip
    draft = replace(draft, findings=findings, rules=rules, coverage=covered)
    requirements = tuple(requirement for demand in options.demands for requirement in demand(draft))
    return Report(
        tool=options.tool,
        settings=_settings(pages, settings, options),
        captures=draft.captures,
        findings=findings,
        rules=rules,
        coverage=covered,
        gate=_gate(taken, findings, requirements, options, [one for one in rules if one.rule in enabled]),
        waivers=tuple(use for excuses in options.excuses for use in excuses(findings)),
        events=draft.events,
        triages=tuple(one.triage for one in taken if one.triage is not None),
        marks=tuple(
            MarkedPlace(one.id, Place(mark.frame + 1, mark.t), mark.words) for one in taken for mark in one.marks
        ),
    )


def _findings(one: JudgedCapture, pages: Mapping[str, Page], settings: Settings, fail_on: FailOn) -> Iterator[Finding]:
    checked = one.checked
    names, coarse = checked.facts.bus_names, checked.coarse
    return FindingMaker(names, pages, settings, capture=one.id, coarse=coarse, fail_on=fail_on).of(checked.outcome)


def _events(one: JudgedCapture, pages: Mapping[str, Page]) -> Iterator[DeviceEvent]:
    return events_from(one.checked.outcome, one.checked.facts.bus_names, pages, capture=one.id)


def _gated(finding: Finding, fail_on: FailOn) -> Finding:
    fails = not finding.excused and fail_on.fails(finding.category, finding.severity)
    return finding if fails == finding.fails else replace(finding, fails=fails)


# ---- verdicts and gate ----------------------------------------------------------------------------------------------


def _session(
    one: JudgedCapture, findings: Sequence[Finding], folded: Sequence[Finding], settings: Settings
) -> verdicts.RatedCapture:
    breaches = folding.breaches(one.id, findings, folded)
    facts = one.checked.facts
    proofs = verdicts.proofs_of(facts, settings.bit_rate, coarse=one.checked.coarse, ends=one.ends)
    lossy = facts.lossy or any(breach.rule in _UNRECORDED for breach in breaches)
    return verdicts.RatedCapture(breaches, one.checked.outcome.words, proofs, lossy=lossy, coarse=one.checked.coarse)


def _rule(rule: str, page: Page, ruling: Ruling, settings: Settings) -> RuleVerdict:
    return RuleVerdict(
        rule=rule,
        title=page.title,
        severity=settings.severities.get(rule, page.severity),
        category=cast("Category", page.category),
        origin=cast("Origin", page.origin),
        clause=page.clause,
        verdict=ruling.verdict,
        findings=ruling.findings,
        reason=f"no {needs(ruling.needs)}" if ruling.needs else ruling.reason,
    )


def _settings(pages: Mapping[str, Page], settings: Settings, options: ReportOptions) -> dict[str, Any]:
    limits = settings.all_numbers(pages)
    changed = [
        f"{rule}.{name}"
        for rule, numbers in limits.items()
        for name, value in numbers.items()
        if value != pages[rule].settings.get(name)
    ]
    severities: dict[str, Severity] = dict(settings.severities)
    return {
        "profile": options.profile,
        "fail_on": list(options.fail_on.names),
        **options.asked,
        "bit_rate": settings.bit_rate,
        **({"severities": severities} if severities else {}),
        "limits": limits,
        "changed": changed,
    }


def _gate(
    taken: Sequence[JudgedCapture],
    findings: Sequence[Finding],
    requirements: tuple[Requirement, ...],
    options: ReportOptions,
    selected: Sequence[RuleVerdict],
) -> Gate:
    unproven = all(rule.verdict in verdicts.UNJUDGED for rule in selected)
    lacks = [(one.id, one.lack(options.least)) for one in taken if not one.unopened]
    missing = [one for one in requirements if not one.met]
    passed = passage(
        sum(finding.fails for finding in findings),
        [f"{name} ({lack})" for name, lack in lacks if lack],
        [one.what for one in missing if not one.expected],
        [one.id for one in taken if one.damage],
        list(map(_unproven, selected)) if unproven and not all(lack for _, lack in lacks) else [],
        [one.what for one in missing if one.expected and not options.fail_on.unlimited],
    )
    return Gate(options.fail_on.names, passed.failed, passed.judged, passed.exit_status, passed.reason, requirements)


def _unproven(rule: RuleVerdict) -> str:
    return f"{rule.rule} {rule.verdict}" + (f" ({rule.reason})" if rule.reason else "")
