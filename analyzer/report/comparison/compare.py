"""From two captures as they were measured to their differences: what matters most first, then what began first."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.report.comparison.kinds import (
    buses,
    commands,
    findings,
    flights,
    losses,
    nodes,
    parameters,
    rates,
    readings,
    telemetry,
)
from analyzer.report.comparison.model import KINDS, WEIGHTS, CaptureDiff, Compared, Matched, Side
from analyzer.report.comparison.pair import Pair
from analyzer.report.wording import plural

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analyzer.report.comparison.failing import DiffGate
    from analyzer.report.comparison.model import Difference
    from analyzer.report.comparison.traits import MeasuredSide

_KINDS = (flights, nodes, readings, parameters, rates, losses, telemetry, commands, findings, buses)


def compare(
    good: MeasuredSide, bad: MeasuredSide, gate: DiffGate, tool: str = "tailbyte", parts: Sequence[str] = ()
) -> CaptureDiff:
    """Return everything that is different, and what that was drawn from; `parts` say what was left out on purpose."""
    pair = Pair(good, bad)
    both = bool(good.facts.transfers and bad.facts.transfers)
    found = ranked([one for kind in _KINDS for one in kind.differences(pair)] if both else [])
    return CaptureDiff(
        tool=tool,
        good=_side(good),
        bad=_side(bad),
        differences=found,
        compared=tuple(one for one in _compared(pair) if one.count),
        cannot=tuple(_cannot(pair)),
        remarks=(*parts, *_remarks(pair)),
        matched=tuple(_matched(pair)),
        limits=dict(pair.limits),
        fail_on=gate.names,
        failed=any(gate.fails(one) for one in found),
    )


def ranked(found: list[Difference]) -> tuple[Difference, ...]:
    """Sort by weight, then by where it begins in the second capture: what is so from its start comes first."""

    def order(one: Difference) -> tuple[int, int, int, float, str, int]:
        began = -1 if one.t_ns is None else one.t_ns
        return WEIGHTS.index(one.weight), began, KINDS.index(one.kind), -one.size, one.bus, one.node or 0

    return tuple(sorted(found, key=order))


def _side(of: MeasuredSide) -> Side:
    capture = of.capture
    return Side(
        path=capture.path,
        form=capture.form,
        sha256=capture.sha256,
        start_ns=of.start,
        end_ns=of.end,
        frames=capture.frames,
        transfers=capture.transfers,
        lost=of.lost,
        buses=tuple(bus.name for bus in capture.buses),
        nodes=len(of.facts.senders),
        can_judge={name: str(answer) for name, answer in capture.can_judge.items()},
        damage=capture.damage,
        arguments=capture.arguments,
    )


def _compared(pair: Pair) -> Iterator[Compared]:
    both = [node for node in pair.matching.nodes if node in pair.mine]
    if not both:
        return
    yield Compared("nodes", len(both))
    named = sum(1 for a, b in pair.matching.nodes.items() if pair.mine[a].software and pair.theirs[b].software)
    yield Compared("software versions", named)
    yield Compared("parameters", parameters.compared(pair))
    yield Compared("rates", rates.compared(pair))
    escs, reports = telemetry.compared(pair)
    yield Compared("ESCs at equal command", escs, f"{reports} reports")
    yield Compared("rules", findings.compared(pair))
    yield Compared("flights", flights.compared(pair))


def _cannot(pair: Pair) -> Iterator[str]:
    """Say what could not be compared, the quality of both captures first."""
    for word, side in (("first", pair.good), ("second", pair.bad)):
        yield from _lacks(word, side)
    if not pair.matching.nodes:
        return
    errors = [side.facts.judge["errors"] == "yes" for side in (pair.good, pair.bad)]
    if not all(errors):
        which = "either" if not any(errors) else "the first" if errors[1] else "the second"
        yield f"error frames: not recorded in {which} capture"
    for word, side in (("first", pair.good), ("second", pair.bad)):
        for bus, node in sorted(side.shared):
            yield f"what node {node} of {bus} lost: two devices have this ID in the {word} capture"
    yield from flights.cannot(pair)
    if not parameters.compared(pair):
        yield "parameters: no node reported the same ones in both"
    if not telemetry.compared(pair)[0] and (pair.good.traits.samples.all or pair.bad.traits.samples.all):
        yield "what ESCs report: too few reports at equal command"
    if not pair.matching.serials:
        yield "exchanged devices: no unique IDs in both"


def _lacks(word: str, side: MeasuredSide) -> Iterator[str]:
    """Say what cannot be compared for want of something in one capture, which `word` calls."""
    if side.capture.damage:
        yield f"what the {word} capture lacks: it is damaged ({side.capture.damage})"
    if not side.facts.transfers:
        yield f"anything: the {word} capture holds no DroneCAN transfer"
        return
    if stray := side.traits.clock.stray:
        yield f"{plural(stray, 'time stamp')} of the {word} capture: far off those around"
    if side.incomplete and not side.capture.damage:
        yield f"rates and losses for sure: the {word} capture is not complete, {side.incomplete}"
    if not side.timed:
        yield f"rates, pauses and what began first: the {word} capture has no times to tell"
    elif side.capture.can_judge.get("timing") == "coarse":
        yield f"timing: the times of the {word} capture are coarse"


def _remarks(pair: Pair) -> Iterator[str]:
    for mine, theirs in pair.matching.renamed:
        yield f"bus {mine} of the first capture is taken for {theirs} of the second"
    if pair.beginning:
        yield pair.beginning
    if pair.matching.strangers:
        yield f"another vehicle: none of {pair.matching.serials} unique IDs is in both"


def _matched(pair: Pair) -> Iterator[Matched]:
    moved = {one.good: "unique ID" if one.serial else "alone of its kind" for one in pair.matching.exchanged}
    names, others = pair.good.facts.bus_names, pair.bad.facts.bus_names
    for node, there in sorted(pair.matching.nodes.items()):
        yield Matched(names[node[0]], node[1], others[there[0]], there[1], moved.get(node, "node ID"))
