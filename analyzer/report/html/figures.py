"""Which plots the HTML report shows, and the table of nodes with their sparklines."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any

from analyzer.report.html import svg as plots
from analyzer.report.model import SEVERITIES, VERDICTS
from analyzer.report.moments import MISSING, Span, clock
from analyzer.views.terminal import escape, fit

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.report.model import BusUse, CaptureSummary, Finding, NodeUse, Report, RuleVerdict

LANES = 40  # of a timeline
BUSES, NODES = 16, 500
TYPES = 6  # of a node
_NAME = 40
_STYLES = {
    "PASS": "pass", "FAIL": "fail", "WARN": "warn", "WAIVED": "waived", "KNOWN": "waived", "NOT EXERCISED": "idle",
    "INCONCLUSIVE": "unsure",
}  # fmt: skip


def timelines(report: Report, linked: int) -> list[dict[str, Any]]:
    """Draw one for each capture with findings that have a time; marks jump to the first `linked` findings."""
    out = []
    for capture in report.captures:
        here = [(n, f) for n, f in enumerate(report.findings[:linked], 1) if f.capture == capture.id]
        timed = [(n, f) for n, f in here if f.first.t_ns is not None]
        span = _span(capture)
        if span is None or not timed:
            continue
        lanes: dict[tuple[str, int | None, str], plots.Lane] = {}
        several = len(capture.buses) > 1
        left = 0
        for number, finding in timed:  # the worst are first, so their lanes are the upper ones
            key = finding.bus, finding.node, finding.label
            if key not in lanes and len(lanes) == LANES:
                left += 1
                continue
            lane = lanes.setdefault(key, plots.Lane(_lane_name(finding, several=several)))
            lane.add(finding.severity, _mark(number, finding))
        out.append(
            {
                "capture": capture.path,
                "axis": plots.axis(span),
                "lanes": [(lane.name, lane.draw(span)) for lane in lanes.values()],
                "left": left,
                "untimed": len(here) - len(timed),
            }
        )
    return out


def buses(report: Report) -> list[dict[str, Any]]:
    """Draw frames per second with the limits, and the load, for each interface of each capture."""
    out = []
    for capture in report.captures:
        for bus in capture.buses[:BUSES]:
            span = _span(capture)
            out.append(
                {
                    "capture": capture.path,
                    "of": bus,
                    "plots": [] if span is None or bus.start_ns is None else _courses(bus, span, bus.start_ns),
                    "axis": None if span is None else plots.axis(span),
                    "over": [name for name, limit in bus.limits.items() if bus.peak > limit],
                }
            )
    return out


def nodes(report: Report) -> dict[str, Any]:
    """Return the table of nodes, with what each of them is accused of."""
    rows: list[dict[str, Any]] = []
    for capture in report.captures:
        accused = Counter((f.bus, f.node, f.severity) for f in report.findings if f.capture == capture.id)
        for node in capture.nodes[: max(NODES - len(rows), 0)]:
            most = sorted(node.types.items(), key=lambda item: (-item[1], item[0]))
            rows.append(
                {
                    "capture": capture.path,
                    "of": node,
                    "types": most[:TYPES],
                    "more": len(most[TYPES:]),
                    "findings": [(s, accused[node.bus, node.node, s]) for s in SEVERITIES],
                    "spark": _spark(node),
                }
            )
    total = sum(len(capture.nodes) for capture in report.captures)
    uses = [use for capture in report.captures for use in capture.nodes]
    return {
        "rows": rows,
        "left": total - len(rows),
        "buses": len({node.bus for node in uses}) > 1,
        "captures": len(report.captures) > 1,
    }


def verdict_bar(rules: Sequence[RuleVerdict]) -> dict[str, Any]:
    """Draw all rules as one bar by verdict, with its legend."""
    counts = Counter(rule.verdict for rule in rules)
    parts = [(_STYLES[verdict], verdict.lower(), counts[verdict]) for verdict in VERDICTS]
    words = ", ".join(f"{count} {name}" for _, name, count in parts)
    legend = [part for part in parts if part[0] != _STYLES["WAIVED"] or part[2]]  # few vehicles have waivers
    return {"bar": plots.shares(parts, f"{len(rules)} rules: {words}"), "legend": legend}


def _span(capture: CaptureSummary) -> Span | None:
    if capture.start_ns is None or capture.end_ns is None:
        return None
    return Span(capture.start_ns, capture.end_ns)


def _lane_name(finding: Finding, *, several: bool) -> str:
    words = [finding.label, "" if finding.node is None else f"node {finding.node}"]
    if several or not any(words):
        words.insert(0, finding.bus)
    return _short(" ".join(word for word in words if word)) or MISSING


def _mark(number: int, finding: Finding) -> plots.PlotMark:
    start = finding.first.t_ns or 0
    return plots.PlotMark(start, max(start, finding.last.t_ns or start), [_short(finding.rule)], f"f{number}")


def _courses(bus: BusUse, span: Span, start: int) -> list[Any]:
    out = []
    if bus.rates:
        top = max(range(len(bus.rates)), key=bus.rates.__getitem__)
        at = clock(start + top * bus.step_ns, 0)
        per_second = [rate * 1e9 / bus.step_ns for rate in bus.rates]
        limits = ", ".join(f"{limit} ({_short(name)})" for name, limit in bus.limits.items())
        title = f"Frames per second on {_short(bus.name)}: mean {bus.mean:.0f}, peak {bus.peak} near {at}"
        out.append(
            plots.course(
                per_second,
                span,
                start,
                bus.step_ns,
                title=f"{title}; limits {limits}" if limits else title,
                unit="/s",
                limits={_short(name): limit for name, limit in bus.limits.items()},
            )
        )
    if bus.load:
        percent = [100 * load for load in bus.load]
        title = f"Load of {_short(bus.name)}: mean {sum(percent) / len(percent):.0f} %, highest {max(percent):.0f} %"
        out.append(plots.course(percent, span, start, bus.step_ns, title=title, unit=" %", top=89, height=100))
    return out


def _spark(node: NodeUse) -> Any:
    if not node.rates:
        return ""
    return plots.sparkline(node.rates, f"Transfers of node {node.node} over time, at most {max(node.rates)} a step")


def _short(text: str) -> str:
    return fit(escape(text[:_NAME]), _NAME)
