"""The headline: the answer in a word, how much is wrong, and what broke worst and who."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from analyzer.report.model import SEVERITIES
from analyzer.report.moments import on_calendar
from analyzer.report.problems import problems
from analyzer.report.wording import captures_by_id, moment, places, plural, safe, several_buses, told

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.report.model import CaptureSummary, Category, Finding, Report
    from analyzer.report.problems import Problem

Tone = Literal["good", "caution", "bad", "idle"]

RANKS: tuple[Category, ...] = ("protocol", "device", "capture")
_NAMED = 3
_LONGEST = 120  # characters of what is told of the worst problem
_PERIODS = 3  # so many times its own period before the end, something still goes on
_TENTH = 100_000_000  # ns


def verdict(report: Report) -> str:
    """Return the answer: PASS, PASS WITH WARNINGS, ERRORS NOT GATED, FAIL or NOT JUDGED, and beside it DAMAGED."""
    damaged = any(capture.damage for capture in report.captures)
    return f"{_answer(report)}, DAMAGED" if damaged else _answer(report)


def tone(report: Report) -> Tone:
    """Return the colour of the answer: only a whole capture without a warning is good."""
    plain: dict[str, Tone] = {"FAIL": "bad", "NOT JUDGED": "idle", "PASS": "good"}
    tone = plain.get(_answer(report), "caution")
    return "caution" if tone == "good" and verdict(report) != "PASS" else tone


def _answer(report: Report) -> str:
    if report.gate.failed:
        return "FAIL"
    if not report.gate.judged or not any(capture.frames for capture in report.captures):
        return "NOT JUDGED"
    severities = {one.severity for one in problems(report.findings) if one.open}
    if "error" in severities:
        return "ERRORS NOT GATED"
    return "PASS WITH WARNINGS" if "warning" in severities else "PASS"


def summary(report: Report, found: Sequence[Problem]) -> str:
    """Write `1 protocol error (ch6), 9 warnings, 3 waived`: errors by category and place, the rest by number.

    Before them stands how much of what a vehicle file expects is not there.
    """
    shown = [one for one in found if one.open]
    missed = sum(one.expected and not one.met for one in report.gate.requirements)
    parts = [f"{plural(missed, 'expectation')} not met"] if missed else []
    for category in RANKS:
        errors = [one for one in shown if one.severity == "error" and one.head.category == category]
        if errors:
            parts.append(plural(len(errors), f"{category} error") + _names(errors))
    for severity in SEVERITIES[1:]:
        count = sum(one.severity == severity for one in shown)
        if count:
            parts.append(plural(count, severity))
    excused = sum(one.waiver is not None for one in found)
    known = sum(one.waiver is None and not one.open for one in found)
    parts += [f"{count} {word}" for count, word in ((excused, "waived"), (known, "known")) if count]
    return ", ".join(parts) or "no findings"


def worst_of(report: Report, *, utc: bool = True) -> str:
    """Write what broke worst, who and how long: `ch1 node 11: ESC in error mode (...) from 08:02:14.502 to the end`.

    Nothing if no error and no warning is open.
    """
    open_ones = [one for one in problems(report.findings) if one.open and one.severity != "note"]
    if not open_ones:
        return ""
    one = worst(open_ones)
    text = told(one)
    because = f" ({text})" if text and len(text) <= _LONGEST else ""
    where = f" in {safe(one.head.capture)}" if len(report.captures) > 1 else ""
    when = _span(one, captures_by_id(report).get(one.head.capture), utc=utc)
    return f"{places(one, bus=several_buses(report))}{where}: {safe(one.head.title)}{because}{when}"


def _span(one: Problem, capture: CaptureSummary | None, *, utc: bool) -> str:
    first, last = one.first.t_ns, one.last.t_ns
    if first is None or last is None:
        return ""
    start, end = (None, None) if capture is None else (capture.start_ns, capture.end_ns)
    zone = " UTC" if utc and on_calendar(first) else ""
    begin = moment(first, start, utc=utc)
    if first == last:
        return f" at {begin}{zone}"
    period = (last - first) // max(one.count - 1, 1)
    if end is not None and end - last <= max(_PERIODS * period, _TENTH):
        return f" from {begin}{zone} to the end"
    return f" from {begin} to {moment(last, start, utc=utc)}{zone}"


def ungated(report: Report) -> str:
    """Say what a pass does not mean: errors that the limits let through, if any."""
    shown = [one for one in problems(report.findings) if one.open and one.severity == "error" and not one.fails]
    if not shown or report.gate.failed:
        return ""
    return f"--fail-on {','.join(report.gate.fail_on)}: {plural(len(shown), 'error')} not counted"


def worst(found: Sequence[Problem]) -> Problem:
    """Return the problem to look at first, of at least one: what fails, then by severity and category, then by time."""
    return min(
        found,
        key=lambda one: (
            not one.fails, SEVERITIES.index(one.severity), RANKS.index(one.head.category), one.first.t_ns or 0
        ),
    )  # fmt: skip


def _names(found: Sequence[Problem]) -> str:
    names = list(dict.fromkeys(_name(one.head) for one in found))
    if names == [""] or not names:
        return ""
    named = [name for name in names if name]
    more = ", ..." if len(named) > _NAMED else ""
    return f" ({', '.join(named[:_NAMED])}{more})"


def _name(finding: Finding) -> str:
    return safe(finding.label) or ("" if finding.node is None else f"node {finding.node}")
