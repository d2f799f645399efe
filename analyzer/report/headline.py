"""The headline: the answer in a word, how much is wrong, and what broke worst and who."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from analyzer.report.model import SEVERITIES
from analyzer.report.moments import on_calendar
from analyzer.report.problems import problems
from analyzer.report.wording import captures_by_id, moment, places, plural, safe, several_buses, told, triage
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analyzer.report.model import CaptureSummary, Category, Report, Severity
    from analyzer.report.problems import Problem

Tone = Literal["good", "caution", "bad", "idle"]

RANKS: tuple[Category, ...] = ("protocol", "device", "capture")
_TONES: dict[str, Tone] = {"FAIL": "bad", "NOT JUDGED": "idle", "PASS": "good"}
_NAMED = 3
_LONGEST = 120  # characters of what is told of the worst problem
_PERIODS = 3  # so many times its own period before the end, something still goes on
_TENTH = 100_000_000  # ns


@dataclass(frozen=True, slots=True)
class TriageHeadline:
    """The words of triage on a flight, and the command that says more, empty if nothing was wrong."""

    text: str
    command: str


@dataclass(frozen=True, slots=True)
class Headline:
    """The first lines of a report.

    `verdict` is PASS, PASS WITH WARNINGS, ERRORS NOT GATED, FAIL or NOT JUDGED, and beside it DAMAGED; `tone` is the
    colour of that: only a whole capture without a warning is good. `summary` counts the troubles, `worst` says what
    broke worst and who, `ungated` what a pass does not mean; the last two may be empty. `happened` are what triage says
    of the last flight of each capture, `problems` the lines of the report, waived and known ones among them.
    """

    verdict: str
    tone: Tone
    summary: str
    worst: str
    ungated: str
    happened: tuple[TriageHeadline, ...]
    problems: tuple[Problem, ...]


def of(report: Report, *, utc: bool = True) -> Headline:
    """Return the headline of a report, with times of day in UTC or else in local time."""
    found = problems(report.findings)
    shown = [one for one in found if one.open]
    answer = _answer(report, shown)
    damaged = any(capture.damage for capture in report.captures)
    doubtful = damaged or any(one.triage is not None and one.triage.wrong for one in report.captures)
    tone: Tone = "caution" if doubtful and answer == "PASS" else _TONES.get(answer, "caution")
    return Headline(
        verdict=f"{answer}, DAMAGED" if damaged else answer,
        tone=tone,
        summary=_summary(report, found),
        worst=_worst(report, shown, utc=utc),
        ungated=_ungated(report, shown),
        happened=tuple(_happened(report, utc=utc)),
        problems=tuple(found),
    )


def _answer(report: Report, shown: Sequence[Problem]) -> str:
    if report.gate.failed:
        return "FAIL"
    if not report.gate.judged or not any(capture.frames for capture in report.captures):
        return "NOT JUDGED"
    severities = {one.severity for one in shown}
    if "error" in severities:
        return "ERRORS NOT GATED"
    return "PASS WITH WARNINGS" if "warning" in severities else "PASS"


def _summary(report: Report, found: Sequence[Problem]) -> str:
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


def _happened(report: Report, *, utc: bool) -> Iterator[TriageHeadline]:
    """Yield what broke first in the last flight of each capture, and how the whole of it is shown."""
    for capture in report.captures:
        if (one := capture.triage) is None:
            continue
        where = f"{safe(capture.id)}: " if len(report.captures) > 1 else ""
        support = f" ({one.support})" if one.support else ""
        at = _at(one.t_end_ns, capture, utc=utc) if one.support and one.t_end_ns is not None else ""
        of = f"flight {one.flight}" if one.flights == 1 else f"flight {one.flight} of {one.flights}"
        command = "" if one.kind == "none" and not one.wrong else triage(capture)
        yield TriageHeadline(f"{where}{safe(one.title)}{support}{at}; {of}, {one.ending}", command)


def _worst(report: Report, shown: Sequence[Problem], *, utc: bool) -> str:
    """Write what broke worst, who and how long: `ch1 node 11: ESC in error mode (...) from 08:02:14.502 to the end`.

    Nothing if no error and no warning is open.
    """
    serious = [one for one in shown if one.severity != "note"]
    if not serious:
        return ""
    one = worst(serious)
    text = _begun(one)
    because = f" ({text})" if text and len(text) <= _LONGEST else ""
    where = f" in {safe(one.head.capture)}" if len(report.captures) > 1 else ""
    when = _span(one, captures_by_id(report).get(one.head.capture), utc=utc)
    return f"{places(one, bus=several_buses(report))}{where}: {safe(one.head.title)}{because}{when}"


def _begun(one: Problem) -> str:
    """Write what is wrong; of what lasted only how it began, as the line says how long that was."""
    first = one.head.examples[0].text if one.head.examples else ""
    return safe(first) if 0 < len(first) < len(one.head.text) else told(one)


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


def _at(t: int, capture: CaptureSummary, *, utc: bool) -> str:
    return f" at {moment(t, capture.start_ns, utc=utc)}{' UTC' if utc and on_calendar(t) else ''}"


def _ungated(report: Report, shown: Sequence[Problem]) -> str:
    """Say what a pass does not mean: errors that the limits let through, if any."""
    passed = [one for one in shown if one.severity == "error" and not one.fails]
    if not passed or report.gate.failed:
        return ""
    return f"--fail-on {','.join(report.gate.fail_on)}: {plural(len(passed), 'error')} not counted"


def sections(found: Sequence[Problem]) -> list[tuple[Category, list[Problem]]]:
    """Return problems by category, errors before warnings before notes; neighbours of one category are joined."""
    made: list[tuple[Category, list[Problem]]] = []
    alike: dict[tuple[Severity, Category], list[Problem]] = {}
    for one in found:
        alike.setdefault((one.severity, one.head.category), []).append(one)
    for severity in SEVERITIES:
        before = made[-1][0] if made else None
        for category in sorted(RANKS, key=lambda one: one != before):
            some = alike.get((severity, category), [])
            if some and made and made[-1][0] == category:
                made[-1][1].extend(some)
            elif some:
                made.append((category, some))
    return made


def worst(found: Sequence[Problem]) -> Problem:
    """Return the problem to look at first, of at least one: what fails, then by severity and category, then by time."""
    return min(
        found,
        key=lambda one: (
            not one.fails, SEVERITIES.index(one.severity), RANKS.index(one.head.category), one.first.t_ns or 0
        ),
    )  # fmt: skip


def _names(found: Sequence[Problem]) -> str:
    names = [safe(name) for name in dict.fromkeys(name for one in found for name in one.places) if name]
    more = ", ..." if len(names) > _NAMED else ""
    return f" ({', '.join(names[:_NAMED])}{more})" if names else ""
