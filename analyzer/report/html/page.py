"""The report as one HTML file: no network, no need for scripts, and nothing from a capture that a browser would obey.

Texts from a capture are made printable (`visible`) and then escaped by the template engine, every one of them: no
filter of ours marks text as safe. A Content-Security-Policy names the only style and script that may act, by
their hashes. `parts` holds what all pages share.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from analyzer.report import headline
from analyzer.report.html import figures, sections
from analyzer.report.html.parts import environment, policy
from analyzer.report.html.triage import section
from analyzer.report.model import CATEGORIES, SEVERITIES, VERDICTS
from analyzer.report.wording import captures_by_id, events, waived

if TYPE_CHECKING:
    from markupsafe import Markup

    from analyzer.report.model import CaptureSummary, Finding, Report

FINDINGS_BYTES = 8_500_000
EVIDENCE_LINES = 20_000  # of all findings together
_FEWEST_LINES, _MOST_LINES = 3, 60  # of one finding
_TRIAGES = 8


def render(report: Report) -> str:
    """Write the whole file. The same report gives the same text."""
    templates = environment(__package__)
    head, shown = headline.of(report), _findings(report)
    return templates.get_template("report.html.j2").render(
        report=report,
        policy=policy(templates, "report.js"),
        headline=head,
        triages=[section(found, k) for k, found in enumerate(report.triages[:_TRIAGES], 1)],
        more_triages=len(report.triages[_TRIAGES:]),
        tally=sections.tally(head.problems),
        captures=[sections.capture_facts(capture) for capture in report.captures],
        timelines=figures.timelines(report, len(shown)),
        buses=figures.buses(report),
        nodes=figures.nodes(report),
        shown=shown,
        events=events(report),
        left_out=len(report.findings) - len(shown),
        verdict_bar=figures.verdict_bar(report.rules),
        rules={verdict: [rule for rule in report.rules if rule.verdict == verdict] for verdict in VERDICTS},
        first_finding=_first_findings(report, len(shown)),
        coverage=sections.coverage(report.coverage),
        settings=sections.settings(report.settings),
        waivers=[(waiver, waived(waiver)) for waiver in report.waivers],
        severities=SEVERITIES,
        categories=CATEGORIES,
    )


def _findings(report: Report) -> list[Markup]:
    """Write the findings one by one, until the file would become too large to open."""
    macro = environment(__package__).get_template("finding.html.j2").module.finding  # type: ignore[attr-defined]  # of the template
    captures = captures_by_id(report)
    room = min(max(EVIDENCE_LINES // max(len(report.findings), 1), _FEWEST_LINES), _MOST_LINES)
    several = len(report.captures) > 1
    out: list[Markup] = []
    size = 0
    for number, finding in enumerate(report.findings, 1):
        written = macro(
            number, finding, sections.who(finding), _details(finding, captures.get(finding.capture), room), several
        )
        size += len(written.encode())
        if size > FINDINGS_BYTES:
            break
        out.append(written)
    return out


def _details(finding: Finding, capture: CaptureSummary | None, room: int) -> dict[str, Any]:
    return {
        "commands": sections.commands(finding, capture),
        "examples": list(sections.examples(finding, room)),
        "more": max(sum(len(example.lines) for example in finding.examples) - room, 0),
    }


def _first_findings(report: Report, shown: int) -> dict[str, str]:
    """Return where to jump from a rule."""
    links: dict[str, str] = {}
    for number, finding in enumerate(report.findings[:shown], 1):
        links.setdefault(finding.rule, f"f{number}")
    return links
