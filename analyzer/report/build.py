"""From what the rules found in each capture to one report: findings with names, verdicts, coverage, the gate."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, cast

from analyzer.engine import LINES
from analyzer.facts.names import short
from analyzer.report import folding
from analyzer.report.explain import needs
from analyzer.report.model import (
    SEVERITIES,
    BusUse,
    Capture,
    Coverage,
    Example,
    Finding,
    Gate,
    NodeUse,
    Place,
    Report,
    Requirement,
    RuleVerdict,
)
from analyzer.report.problems import MOST_FRAMES
from analyzer.rules import coverage, verdicts
from analyzer.rules.gate import FailOn, passage
from analyzer.tables import VERDICTS
from dissectors.conformance import NO_TIME, SECOND

if TYPE_CHECKING:
    from analyzer.facts.summary import Facts, NodeFacts
    from analyzer.report.model import Category, Judgeable, Origin, Severity
    from analyzer.rules.catalogue import Page
    from analyzer.rules.checking import Checked
    from analyzer.rules.findings import Run, Shown
    from analyzer.rules.settings import Settings
    from analyzer.rules.verdicts import Ruling
    from dissectors import Registry

_ANSWERS: dict[str, Judgeable] = {"yes": "yes", "NO": "no"}
_EVERY_BUS = -1


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


@dataclass(frozen=True, slots=True)
class Order:
    """What is asked of a report. `asked` are options to be printed with the settings."""

    tool: str
    fail_on: FailOn
    asked: Mapping[str, Any] = field(default_factory=dict)
    profile: str = ""
    revise: Sequence[Revise] = ()
    demands: Sequence[Demand] = ()


def build(
    taken: Sequence[Taken], registry: Registry, pages: Mapping[str, Page], settings: Settings, order: Order
) -> Report:
    """The report of all captures, judged with the same settings."""
    enabled = settings.enabled(pages)
    captures = tuple(_capture(one, registry, pages, settings) for one in taken)
    found = [finding for one in taken for finding in _findings(one, pages)]
    shown, folded = folding.fold(_ranked(found))
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
        gate=_gate(taken, findings, requirements, order.fail_on),
    )


def _ranked(found: Iterable[Finding]) -> tuple[Finding, ...]:
    def order(one: Finding) -> tuple[int, int]:
        return SEVERITIES.index(one.severity), -1 if one.first.t_ns is None else one.first.t_ns

    return tuple(sorted(found, key=order))


def _fails(finding: Finding, fail_on: FailOn) -> bool:
    counts = finding.waiver is None and finding.baseline != "known"
    return counts and fail_on.fails(finding.category, finding.severity)


# ---- findings -------------------------------------------------------------------------------------------------------


def _findings(one: Taken, pages: Mapping[str, Page]) -> Iterable[Finding]:
    names = one.checked.facts.bus_names
    for key, run in one.checked.outcome.runs:
        page = pages[key.rule]
        label = one.checked.outcome.labels.get((key.bus, key.node), "")
        yield Finding(
            rule=key.rule,
            title=page.title,
            severity=key.severity,
            category=cast("Category", page.category),
            origin=cast("Origin", page.origin),
            clause=page.clause,
            capture=one.id,
            bus="" if key.bus == _EVERY_BUS else names[key.bus],
            node=None if key.node < 0 else key.node,
            label=label,
            type=key.type,
            key=key.key,
            **_course(run),
        )


def _course(run: Run) -> dict[str, Any]:
    frames = dict.fromkeys(number + 1 for shown in run.examples for number in _evidence(shown))
    shown = run.examples[0] if run.examples else None
    return {
        "count": run.count,
        "first": _place(*run.first),
        "last": _place(*run.last),
        "frames": tuple(frames)[:MOST_FRAMES],
        "cause": "" if shown is None else shown.cause,
        "text": "" if shown is None else shown.text,
        "examples": tuple(map(_example, run.examples)),
    }


def _evidence(shown: Shown) -> Sequence[int]:
    """The frame where an occurrence is; for one without, what it is concluded from."""
    return (shown.frame,) if shown.frame >= 0 else shown.frames


def _example(shown: Shown) -> Example:
    place = _place(shown.t, shown.frame)
    return Example(place.frame, place.t_ns, shown.text, shown.lines)


def _place(t: int, frame: int) -> Place:
    return Place(None if frame < 0 else frame + 1, None if t == NO_TIME else t)


# ---- captures -------------------------------------------------------------------------------------------------------


def _capture(one: Taken, registry: Registry, pages: Mapping[str, Page], settings: Settings) -> Capture:
    facts = one.checked.facts
    return Capture(
        id=one.id,
        path=one.path,
        sha256="" if one.live or one.unopened else ", ".join(file.sha256 for file in facts.files),
        form=", ".join(dict.fromkeys(file.form for file in facts.files)),
        start_ns=facts.start,
        end_ns=facts.end,
        frames=facts.lines["frames"],
        transfers=facts.transfers,
        accounting={name: facts.lines[name] for name in LINES},
        verdicts=dict(facts.verdicts),
        can_judge=_can_judge(facts, settings),
        dialects=_dialects(facts),
        buses=tuple(_buses(one, pages, settings)),
        nodes=tuple(_nodes(one, registry)),
        damage=one.damage,
        arguments=one.arguments,
    )


def _can_judge(facts: Facts, settings: Settings) -> dict[str, Judgeable]:
    found = {what: _ANSWERS.get(answer, "unknown") for what, answer in facts.judge.items()}
    return {**found, "bit rate": "no" if settings.bit_rate is None else "yes"}


def _dialects(facts: Facts) -> dict[str, dict[str, str]]:
    found: dict[str, dict[str, str]] = {}
    for one in facts.readings:
        found.setdefault(f"{facts.bus_names[one.bus]}:{one.node}", {})[f"{one.message}.{one.field}"] = one.choice
    return found


def _buses(one: Taken, pages: Mapping[str, Page], settings: Settings) -> Iterable[BusUse]:
    facts, course = one.checked.facts, one.checked.course
    numbers = settings.all_numbers(pages)
    limits = {
        page.exercised: int(numbers[rule]["limit_per_s"])
        for rule, page in pages.items()
        if "limit_per_s" in page.settings and ":" not in page.exercised
    }
    for bus in facts.buses:
        index = facts.bus_names.index(bus.name)
        a_step = (settings.bit_rate or 0) * course.step // SECOND  # bits that fit
        yield BusUse(
            name=bus.name,
            frames=bus.frames,
            mean=bus.mean or 0.0,
            peak=bus.peak or 0,
            bit_rate=settings.bit_rate,
            start_ns=course.start,
            step_ns=course.step,
            load=tuple(bits / a_step for bits in course.bits(index)) if a_step else (),
            rates=course.frames(index),
            limits=limits,
        )


def _nodes(one: Taken, registry: Registry) -> Iterable[NodeUse]:
    facts = one.checked.facts
    groups: dict[tuple[str, int], list[NodeFacts]] = {}
    for sent in facts.nodes:
        groups.setdefault((sent.bus, sent.node), []).append(sent)
    for (bus, node), sent_ in sorted(groups.items(), key=lambda item: (facts.bus_names.index(item[0][0]), item[0][1])):
        yield _node(one, registry, bus, node, sent_)


def _node(one: Taken, registry: Registry, bus: str, node: int, sent: Sequence[NodeFacts]) -> NodeUse:
    checked = one.checked
    at = (checked.facts.bus_names.index(bus), node)
    types: dict[str, int] = {}
    for what in sent:
        name = short(what.sends) + (f" {what.kind}" if what.kind in ("request", "response") else "")
        types[name] = types.get(name, 0) + what.count
    rates = [what.hz for what in sent if what.hz is not None]
    label = checked.outcome.labels.get(at, "")
    return NodeUse(
        bus=bus,
        node=node,
        label=label,
        name=checked.names.get(at, ""),
        role="ESC" if label else "commands" if any(_actuates(what, registry) for what in sent) else "",
        software=next((what.software for what in sent if what.software), ""),
        types=types,
        hz=sum(rates) if rates else None,
        bad=sum(what.bad for what in sent),
        first_ns=min((what.first for what in sent if what.first is not None), default=None),
        last_ns=max((what.last for what in sent if what.last is not None), default=None),
        rates=checked.course.transfers(*at),
    )


def _actuates(sent: NodeFacts, registry: Registry) -> bool:
    if sent.kind != "message" or not sent.known:
        return False
    message = registry.message(0, sent.type_id)
    return message is not None and message.actuates


# ---- verdicts and gate ----------------------------------------------------------------------------------------------


def _session(
    one: Taken, findings: Sequence[Finding], folded: Sequence[Finding], settings: Settings
) -> verdicts.Session:
    breaches = folding.breaches(one.id, findings, folded)
    facts = one.checked.facts
    proofs = verdicts.proofs_of(facts, settings.bit_rate)
    return verdicts.Session(breaches, one.checked.outcome.words, proofs, lossy=facts.judge["drops"] == "yes")


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
    taken: Sequence[Taken], findings: Sequence[Finding], requirements: tuple[Requirement, ...], fail_on: FailOn
) -> Gate:
    passed = passage(
        sum(finding.fails for finding in findings),
        [one.id for one in taken if not one.unopened and not _judgeable(one.checked.facts)],
        [requirement.what for requirement in requirements if not requirement.met],
        [one.id for one in taken if one.damage],
    )
    return Gate(fail_on.names, passed.failed, passed.judged, passed.exit_status, passed.reason, requirements)


def _judgeable(facts: Facts) -> bool:
    """Whether there was anything of DroneCAN in it."""
    return facts.transfers > 0 or facts.verdicts[VERDICTS[0]] > 0
