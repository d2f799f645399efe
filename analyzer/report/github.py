"""The report for GitHub Actions: annotations as workflow commands, and the text of the step summary."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.report import headline, markdown, wording
from analyzer.report.problems import ranked
from analyzer.views.terminal import ELLIPSIS

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.report.model import Report
    from analyzer.report.problems import Problem

    _Annotation = tuple[str, list[str]]  # title, lines

MOST_ANNOTATIONS = 10  # of one level; GitHub drops what comes after them
SUMMARY_BYTES = 1_000_000  # GitHub refuses a summary above 1 MiB
_LEVELS = {"error": "error", "warning": "warning", "note": "notice"}
_TONES = {"bad": "error", "idle": "error", "caution": "warning", "good": "notice"}
_LONGEST = 600


def commands(report: Report) -> str:
    """Write workflow commands, a line each, for standard output: at most 10 a level, the most important first."""
    return "".join(f"{line}\n" for line in _commands(report))


def summary(report: Report) -> str:
    """Write what to append to the file of `$GITHUB_STEP_SUMMARY`: the report as Markdown, with all of its table."""
    return markdown.render(report, SUMMARY_BYTES)


def _commands(report: Report) -> Iterator[str]:
    by_level: dict[str, list[_Annotation]] = {level: [] for level in _LEVELS.values()}
    head = headline.of(report)
    words = [head.summary, head.worst, report.gate.reason, *(f"Triage: {one.text}" for one in head.happened)]
    by_level[_TONES[head.tone]].append((head.verdict, [*filter(None, words)]))
    by_level["error"] += [
        ("Damaged capture", [f"{capture.path}: {capture.damage}"]) for capture in report.captures if capture.damage
    ]
    by_level["error"] += [
        (
            "Expectation not met" if requirement.expected else "Requirement not met",
            [f"{requirement.what}: found {requirement.found}"],
        )
        for requirement in report.gate.requirements
        if not requirement.met
    ]
    for one in ranked(head.problems):
        if one.open:
            by_level[_LEVELS[one.severity]].append(_annotation(one, report))
    for level, found in by_level.items():
        hidden = len(found) - MOST_ANNOTATIONS
        for k, (title, text) in enumerate(found[:MOST_ANNOTATIONS], 1):
            more = hidden > 0 and k == MOST_ANNOTATIONS
            lines = [*text, *([f"and {hidden} more, see the summary of this step"] if more else [])]
            yield f"::{level} title={_property(_line(title))}::{_data(chr(10).join(map(_line, lines)))}"


def _annotation(one: Problem, report: Report) -> _Annotation:
    head = one.head
    capture = wording.captures_by_id(report).get(head.capture)
    title = f"{head.rule} {wording.places(one, bus=wording.several_buses(report))}: {head.title}"
    text = [f"{wording.told(one)} ({wording.counted(one)}{f', {head.type}' if head.type else ''})"]
    return title, [*text, wording.command(one, capture), f"tailbyte explain {head.rule}"]


def _line(text: str) -> str:
    text = wording.safe(text)
    return text if len(text) <= _LONGEST else text[: _LONGEST - 1] + ELLIPSIS


def _data(text: str) -> str:
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _property(text: str) -> str:
    return _data(text).replace(":", "%3A").replace(",", "%2C")
