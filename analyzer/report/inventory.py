"""Additions of `--all` to the text: nodes, readings, every rule with its verdict, coverage, and all settings."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.report import wording
from analyzer.report.lines import pack, wrap
from analyzer.views.terminal import Palette, fit

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from analyzer.report.model import CaptureSummary, Coverage, Report, RuleVerdict

_INDENT = " " * 9
_STYLES = {"FAIL": "bad", "WARN": "note", "WAIVED": "note", "INCONCLUSIVE": "note"}


def inventory(report: Report, width: int, palette: Palette) -> Iterator[str]:
    """Give lines of at most `width` columns, each list behind a title."""
    for rule in report.rules:
        yield from _rule(rule, width, palette)
    for capture in report.captures:
        yield ""
        title = "NODES" if len(report.captures) == 1 else f"NODES    {wording.safe(capture.id)}"
        yield palette.paint("head", title)
        yield from _nodes(capture, width)
        yield from _accounts(capture, width)
    yield ""
    yield palette.paint("head", "COVERAGE")
    yield from _coverage(report.coverage, width)
    yield ""
    yield palette.paint("head", "SETTINGS") + "  * is not the default"
    for name, value in report.settings.items():
        if name not in ("limits", "changed"):
            start = f"{wording.safe(str(name)):<8} "
            yield from wrap(wording.setting(value), width, first=start, indent=_INDENT)
    for line in wording.limits(report):
        name, _, numbers = line.partition(" ")
        yield from wrap(numbers, width, first=f"{name:<8} ", indent=_INDENT)


def _rule(rule: RuleVerdict, width: int, palette: Palette) -> Iterator[str]:
    name, word = wording.safe(rule.rule), rule.verdict
    start = f"{name:<8} {word:<13}  "
    count = f" ({wording.plural(rule.findings, 'finding')})" if rule.findings else ""
    reason = f" - {wording.safe(rule.reason)}" if rule.reason else ""
    first, *more = wrap(f"{wording.safe(rule.title)}{count}{reason}", width, first=start, indent=" " * len(start))
    at = len(name.ljust(8)) + 1
    painted = palette.paint(_STYLES[word], word) if word in _STYLES else word
    yield first[:at] + painted + first[at + len(word) :]
    yield from more


def _nodes(capture: CaptureSummary, width: int) -> Iterator[str]:
    for node in capture.nodes:
        types = ", ".join(f"{wording.safe(name)} {count}x" for name, count in node.types.items())
        words = [f"node {node.node}", wording.safe(node.bus), wording.safe(node.label), wording.safe(node.role)]
        words += [wording.safe(node.name), wording.safe(node.software), types]
        words += ["" if node.hz is None else f"{node.hz:.1f} Hz", f"{node.bad} bad" if node.bad else ""]
        yield from pack(words, width, "")
    for bus in capture.buses:
        load = f"load up to {100 * max(bus.load):.0f} %" if bus.load else ""
        words = [wording.safe(bus.name), wording.plural(bus.frames, "frame")]
        yield from pack([*words, f"mean {bus.mean:.1f}/s", f"peak {bus.peak}/s", load], width, "bus ")


def _accounts(capture: CaptureSummary, width: int) -> Iterator[str]:
    for title, counts in (("lines", capture.accounting), ("frames", capture.verdicts)):
        text = ", ".join(f"{wording.safe(name)} {count}" for name, count in counts.items())
        if text:
            yield from wrap(text, width, first=f"{title:<8} ", indent=_INDENT)
    for node, readings in capture.dialects.items():
        text = ", ".join(f"{wording.safe(field)} {wording.safe(choice)}" for field, choice in readings.items())
        yield from wrap(f"{wording.safe(node)}: {text}", width, first="reading  ", indent=_INDENT)


def _coverage(coverage: Coverage, width: int) -> Iterator[str]:
    yield from _seen("types", coverage.types, width)
    yield from _seen("packets", coverage.packets, width)
    for field, values in coverage.values.items():
        yield from _seen(field, values, width)
    verdicts = ", ".join(f"{wording.safe(name)} {verdict.lower()}" for name, verdict in coverage.clauses.items())
    if verdicts:
        yield from wrap(verdicts, width, first="clauses  ", indent=_INDENT)
    if coverage.never:
        text = "; ".join(map(wording.safe, coverage.never))
        yield from wrap(f"no capture can show: {text}", width, first=_INDENT, indent=_INDENT)


def _seen(title: str, counts: Mapping[str, int], width: int) -> Iterator[str]:
    if not counts:
        return
    seen = [f"{wording.safe(name)} {count}x" for name, count in counts.items() if count]
    missing = [wording.safe(name) for name, count in counts.items() if not count]
    text = f"{len(seen)} of {len(counts)}: {', '.join(seen) or 'none'}"
    text += f"; not seen: {', '.join(missing)}" if missing else ""
    name = fit(wording.safe(title), width // 2)
    yield from wrap(text, width, first=f"{name:<8} ", indent=_INDENT)
