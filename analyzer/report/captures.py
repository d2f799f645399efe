"""The facts of each capture in a report: its sums, what it can show, its buses and nodes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.decode.core import LINES
from analyzer.facts.names import short
from analyzer.report.model import BusUse, CaptureSummary, NodeUse, TriageSummary
from dissectors.kit import SECOND

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from analyzer.facts.summary import Facts, NodeFacts
    from analyzer.flight.verdict.model import Triage
    from analyzer.report.draft import JudgedCapture
    from analyzer.report.model import Judgeable
    from analyzer.rules.catalogue import Page
    from analyzer.rules.settings import Settings
    from dissectors import Registry

_ANSWERS: dict[str, Judgeable] = {"yes": "yes", "NO": "no", "unknown": "unknown"}


def describe_capture(
    one: JudgedCapture, registry: Registry, pages: Mapping[str, Page], settings: Settings
) -> CaptureSummary:
    """Return the capture with its sums, buses and nodes."""
    facts = one.checked.facts
    return CaptureSummary(
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
        can_judge=_can_judge(one, settings),
        dialects=_dialects(facts),
        buses=tuple(_buses(one, pages, settings)),
        nodes=tuple(_nodes(one, registry)),
        damage=one.damage,
        arguments=one.arguments,
        triage=None if one.triage is None else _happened(one.triage),
    )


def _happened(found: Triage) -> TriageSummary | None:
    """Return what broke first in the last flight; None if there was none."""
    first, flight = found.first, found.flight
    if flight is None:
        return None
    return TriageSummary(
        kind=first.kind,
        title=first.title,
        support=first.support if first.told else "",
        bus="" if first.bus is None else found.buses[first.bus],
        node=first.node,
        ch=first.ch,
        t_ns=first.t,
        t_end_ns=first.t_end,
        frame=None if first.frame is None else first.frame + 1,
        flight=flight.number,
        flights=len(found.flights),
        end=flight.end,
        wrong=found.wrong,
    )


def _can_judge(one: JudgedCapture, settings: Settings) -> dict[str, Judgeable | str]:
    found = {what: _ANSWERS.get(answer, answer) for what, answer in one.checked.facts.judge.items()}
    stamps = found.pop("stamps")
    if one.checked.coarse and one.timed:
        found["timing"] = "coarse"
    return {**found, "bit rate": "no" if settings.bit_rate is None else "yes", "stamps": stamps}


def _dialects(facts: Facts) -> dict[str, dict[str, str]]:
    found: dict[str, dict[str, str]] = {}
    for one in facts.readings:
        found.setdefault(f"{facts.bus_names[one.bus]}:{one.node}", {})[f"{one.message}.{one.field}"] = one.choice
    return found


def _buses(one: JudgedCapture, pages: Mapping[str, Page], settings: Settings) -> Iterable[BusUse]:
    facts, course = one.checked.facts, one.checked.course
    numbers = settings.all_numbers(pages)
    limits = {
        page.exercised: int(numbers[rule]["limit_per_s"])
        for rule, page in pages.items()
        if "limit_per_s" in page.settings and ":" not in page.exercised
    }
    words = one.checked.outcome.words
    if words and words.isdisjoint(limits):
        limits = {}  # they are of a vendor of whom nothing was heard
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


def _nodes(one: JudgedCapture, registry: Registry) -> Iterable[NodeUse]:
    facts = one.checked.facts
    groups: dict[tuple[str, int], list[NodeFacts]] = {}
    for sent in facts.nodes:
        groups.setdefault((sent.bus, sent.node), []).append(sent)
    for (bus, node), sent_ in sorted(groups.items(), key=lambda item: (facts.bus_names.index(item[0][0]), item[0][1])):
        yield _node(one, registry, bus, node, sent_)


def _node(one: JudgedCapture, registry: Registry, bus: str, node: int, sent: Sequence[NodeFacts]) -> NodeUse:
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
