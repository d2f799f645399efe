"""The report as one HTML file: no network, no need for scripts, and nothing from a capture that a browser would obey.

Texts from a capture are made printable (`visible`) and then escaped by the template engine, every one of them: no
filter of ours marks text as safe. A Content-Security-Policy names the only style and script that may act, by
their hashes.
"""

from __future__ import annotations

import base64
import hashlib
from functools import cache
from typing import TYPE_CHECKING, Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from analyzer.report import headline
from analyzer.report.html import figures, sections
from analyzer.report.model import CATEGORIES, SEVERITIES, VERDICTS
from analyzer.report.moments import clock, moment
from analyzer.report.wording import captures_by_id, events, waived
from analyzer.views.terminal import ELLIPSIS, escape

if TYPE_CHECKING:
    from analyzer.report.model import CaptureSummary, Finding, Report

LONGEST_TEXT = 400  # characters
LONGEST_NAME = 60
FINDINGS_BYTES = 8_500_000
EVIDENCE_LINES = 20_000  # of all findings together
_FEWEST_LINES, _MOST_LINES = 3, 60  # of one finding


def render(report: Report) -> str:
    """Write the whole file. The same report gives the same text."""
    environment = _environment()
    head, shown = headline.of(report), _findings(report)
    return environment.get_template("report.html.j2").render(
        report=report,
        policy=_policy(environment),
        headline=head,
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


def visible(value: Any) -> Any:
    r"""Return what a template prints: text without anything invisible or misleading (`\x1b`), of bounded length."""
    if isinstance(value, Markup) or not isinstance(value, str):
        return value
    return _cut(value, LONGEST_TEXT)


def _name(value: object) -> str:
    """Filter what should be short."""
    return _cut(str(value), LONGEST_NAME)


def _cut(text: str, limit: int) -> str:
    printable = escape(text[: limit + 1])
    return printable if len(printable) <= limit else printable[: limit - 1] + ELLIPSIS


def _count(number: int) -> str:
    return f"{number:,}"


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("analyzer.report.html"),
        autoescape=True,
        undefined=StrictUndefined,
        finalize=visible,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"name": _name, "count": _count, "moment": moment, "clock": clock}
    return environment


def _policy(environment: Environment) -> str:
    """Return a policy: nothing may be loaded, sent or run but the style and the script of this file."""
    hashes = {}
    for kind, source in (("style-src", "report.css"), ("script-src", "report.js")):
        digest = hashlib.sha256(environment.get_template(source).render().encode()).digest()
        hashes[kind] = base64.b64encode(digest).decode()
    allowed = "; ".join(f"{kind} 'sha256-{digest}'" for kind, digest in hashes.items())
    return f"default-src 'none'; {allowed}; base-uri 'none'; form-action 'none'"


def _findings(report: Report) -> list[Markup]:
    """Write the findings one by one, until the file would become too large to open."""
    macro = _environment().get_template("finding.html.j2").module.finding  # type: ignore[attr-defined]  # of the template
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
