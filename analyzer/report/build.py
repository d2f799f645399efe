"""From what the rules found in each capture to one report: findings with names, verdicts, coverage, the gate."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, cast

from analyzer.report import folding
from analyzer.report.captures import of_capture
from analyzer.report.explain import needs
from analyzer.report.found import ranked, told
from analyzer.report.model import (
    Capture,
    Coverage,
    Finding,
    Gate,
    Report,
    Requirement,
    RuleVerdict,
    WaiverUse,
)
from analyzer.rules import coverage, verdicts
from analyzer.rules.gate import FailOn, passage
from analyzer.tables import VERDICTS

if TYPE_CHECKING:
    from analyzer.report.model import Category, Origin, Severity
    from analyzer.rules.catalogue import Page
    from analyzer.rules.checking import Checked
    from analyzer.rules.settings import Settings
    from analyzer.rules.verdicts import Ruling
    from dissectors import Registry

_GAP = "CAP-002"  # what was sent meanwhile is not recorded


@dataclass(frozen=True, slots=True)
class Taken:
    """A capture as it was taken in. `damage` says what could not be read, `unopened` that this is all of it."""

    id: str
    path: str
    checked: Checked
    damage: str = ""
    unopened: bool = False
    live: bool = False
    arguments: tuple[str, ...] = ()

    @property
    def timed(self) -> bool:
        """Whether it tells how much time went by."""
        return self.checked.facts.judge["timing"] == "yes"

    @property
    def judgeable(self) -> bool:
        """Whether there was anything of DroneCAN in it."""
        return self.checked.facts.transfers > 0 or self.checked.facts.verdicts[VERDICTS[0]] > 0


@dataclass(frozen=True, slots=True)
class Draft:
    """The report so far, for what a vehicle or a baseline has to say of it."""

    taken: tuple[Taken, ...]
    captures: tuple[Capture, ...]
    findings: tuple[Finding, ...]
    rules: tuple[RuleVerdict, ...] = ()
    coverage: Coverage | None = None


Revise = Callable[[Draft], Draft]  # with waivers and labels, or compared with a baseline
Demand = Callable[[Draft], Iterable[Requirement]]
Excuses = Callable[[Sequence[Finding]], Iterable[WaiverUse]]


@dataclass(frozen=True, slots=True)
class Order:
    """What is asked of a report. `asked` are options to be printed with the settings."""

    tool: str
    fail_on: FailOn
    asked: Mapping[str, Any] = field(default_factory=dict)
    profile: str = ""
    revise: Sequence[Revise] = ()
    demands: Sequence[Demand] = ()
    excuses: Sequence[Excuses] = ()


def build(
    taken: Sequence[Taken], registry: Registry, pages: Mapping[str, Page], settings: Settings, order: Order
) -> Report:
    """The report of all captures, judged with the same settings."""
    enabled = settings.enabled(pages)
    captures = tuple(of_capture(one, registry, pages, settings) for one in taken)
    found = [finding for one in taken for finding in _findings(one, pages, settings)]
    shown, folded = folding.fold(ranked(found))
    draft = Draft(tuple(taken), captures, shown)
    for revise in order.revise:
        draft = revise(draft)
    findings = tuple(replace(finding, fails=_fails(finding, order.fail_on)) for finding in draft.findings)
    rulings = verdicts.rulings(pages, enabled, [_session(one, findings, folded, settings) for one in taken])
    rules = tuple(folding.ruled(_rule(rule, pages[rule], ruling, settings), folded) for rule, ruling in rulings.items())
    seen = coverage.added([one.checked.seen for one in taken])
    covered = Coverage(
        dict(seen.types), dict(seen.packets), {name: dict(values) for name, values in seen.values.items()},
        coverage.clauses(pages, rulings), coverage.never(registry),
    )  # fmt: skip
    draft = replace(draft, findings=findings, rules=rules, coverage=covered)
    requirements = tuple(requirement for demand in order.demands for requirement in demand(draft))
    return Report(
        tool=order.tool,
        settings=_settings(pages, settings, order),
        captures=draft.captures,
        findings=findings,
        rules=rules,
        coverage=covered,
        gate=_gate(taken, findings, requirements, order.fail_on, [one for one in rules if one.rule in enabled]),
        waivers=tuple(use for excuses in order.excuses for use in excuses(findings)),
    )


def _findings(one: Taken, pages: Mapping[str, Page], settings: Settings) -> Iterator[Finding]:
    checked = one.checked
    return told(checked.outcome, checked.facts.bus_names, pages, settings, capture=one.id, coarse=checked.coarse)


def _fails(finding: Finding, fail_on: FailOn) -> bool:
    return not finding.excused and fail_on.fails(finding.category, finding.severity)


# ---- verdicts and gate ----------------------------------------------------------------------------------------------


def _session(
    one: Taken, findings: Sequence[Finding], folded: Sequence[Finding], settings: Settings
) -> verdicts.Session:
    breaches = folding.breaches(one.id, findings, folded)
    facts = one.checked.facts
    proofs = verdicts.proofs_of(facts, settings.bit_rate, coarse=one.checked.coarse)
    lossy = facts.lossy or any(breach.rule == _GAP for breach in breaches)
    return verdicts.Session(breaches, one.checked.outcome.words, proofs, lossy=lossy, coarse=one.checked.coarse)


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


def _settings(pages: Mapping[str, Page], settings: Settings, order: Order) -> dict[str, Any]:
    limits = settings.all_numbers(pages)
    changed = [
        f"{rule}.{name}"
        for rule, numbers in limits.items()
        for name, value in numbers.items()
        if value != pages[rule].settings.get(name)
    ]
    severities: dict[str, Severity] = dict(settings.severities)
    return {
        "profile": order.profile,
        "fail_on": list(order.fail_on.names),
        **order.asked,
        "bit_rate": settings.bit_rate,
        **({"severities": severities} if severities else {}),
        "limits": limits,
        "changed": changed,
    }


def _gate(
    taken: Sequence[Taken],
    findings: Sequence[Finding],
    requirements: tuple[Requirement, ...],
    fail_on: FailOn,
    selected: Sequence[RuleVerdict],
) -> Gate:
    unproven = all(rule.verdict in verdicts.UNJUDGED for rule in selected)
    readable = any(one.judgeable for one in taken)
    missing = [one for one in requirements if not one.met]
    passed = passage(
        sum(finding.fails for finding in findings),
        [one.id for one in taken if not one.unopened and not one.judgeable],
        [one.what for one in missing if not one.expected],
        [one.id for one in taken if one.damage],
        list(map(_unproven, selected)) if unproven and readable else [],
        [one.what for one in missing if one.expected and not fail_on.unlimited],
    )
    return Gate(fail_on.names, passed.failed, passed.judged, passed.exit_status, passed.reason, requirements)


def _unproven(rule: RuleVerdict) -> str:
    return f"{rule.rule} {rule.verdict}" + (f" ({rule.reason})" if rule.reason else "")
