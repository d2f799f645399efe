"""The page of a rule: what it checks, why that matters, an example, what to look at next."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from analyzer.report import wording
from analyzer.report.lines import NARROWEST, right, wrap
from analyzer.views.terminal import PLAIN, Palette

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    Page = Mapping[str, Any]

WIDTH = 80
_LABEL = 10
_ORIGINS = {
    "document": "the document says so",
    "implied": "follows from the document",
    "dronecan": "the DroneCAN specification says so",
    "heuristic": "our judgement, no document says so",
    "vehicle": "the vehicle file says so",
}
_PARTS = {"checks": "Checks", "matters": "Matters", "example": "Example", "next": "Next"}
_ACTIVE = re.compile(r"[\\`*_\[\]<>#|&~@$]|(?<=:)/|(?<=www)\.", re.IGNORECASE)


def render(rule: str, page: Page, *, width: int = WIDTH, palette: Palette = PLAIN) -> str:
    """Write the page for a terminal.

    Args:
        rule: its id, like TRF-010.
        page: the keys of the catalogue: title, severity, category, origin, clause, checks, matters, example, next, and
            optionally dronecan, enabled, text, settings, exercised, inconclusive, note, also.
        width: columns, 60 at least.
        palette: colours for a terminal.
    """
    width = max(width, NARROWEST)
    severity = _severity(page)
    first, *more = right(wrap(wording.safe(page["title"]), width, first=f"{rule}  ", indent=" " * 9), severity, width)
    lines = [palette.paint("head", first) if more else _painted(first, severity, palette)]
    lines += [*more[:-1], *(_painted(line, severity, palette) for line in more[-1:]), ""]
    for key, label in _PARTS.items():
        lines += _labelled(label, page[key], width, palette)
    lines.append("")
    for label, text in _facts(page):
        lines += _labelled(label, text, width, palette)
    return "".join(f"{line.rstrip()}\n" for line in lines)


def document(pages: Mapping[str, Page]) -> str:
    """Write all pages as one Markdown document, in the order given."""
    lines = ["# Rules", "", "Each page is what `tailbyte explain RULE` prints.", ""]
    lines += ["| Rule | Severity | Category | Origin | Title |", "|---|---|---|---|---|"]
    for rule, page in pages.items():
        cells = [f"[{prose(rule)}](#{_anchor(rule)})", _severity(page), str(page["category"]), str(page["origin"])]
        lines.append(f"| {' | '.join([*cells, prose(page['title'])])} |")
    for rule, page in pages.items():
        lines += ["", f'<a id="{_anchor(rule)}"></a>', "", f"## {prose(rule)} {prose(page['title'])}", ""]
        lines += [f"**{label}** {prose(page[key])}\n" for key, label in _PARTS.items()]
        facts = dict(_facts(page))
        severity = ". ".join(filter(None, [_severity(page), facts.pop("Severity", "")]))
        lines += [f"- {label}: {prose(text)}" for label, text in (("Severity", severity), *facts.items())]
    return "".join(f"{line}\n" for line in lines)


def _severity(page: Page) -> str:
    """Return `event` for what is no breach."""
    return "event" if page.get("event") else str(page["severity"])


def prose(text: str) -> str:
    """Write text as Markdown that shows just this text: no markup, no links."""
    return _ACTIVE.sub(lambda found: f"\\{found[0]}", wording.safe(text))


def _anchor(rule: str) -> str:
    return re.sub(r"[^a-z0-9-]", "-", rule.lower())


def _painted(line: str, severity: str, palette: Palette) -> str:
    start = line[: len(line) - len(severity)]
    return palette.paint("head", start) + palette.paint(wording.STYLES.get(severity, "note"), severity)


def _facts(page: Page) -> Iterator[tuple[str, str]]:
    origin = str(page["origin"])
    yield "Origin", _ORIGINS.get(origin, origin)
    clauses = [str(page["clause"])] if page["clause"] not in ("", "-") else []
    clauses += [f"DroneCAN {page['dronecan']}"] if page.get("dronecan") else []
    if clauses:
        yield "Clause", "; ".join(clauses)
    yield "Category", str(page["category"])
    if not page.get("enabled", True):
        yield "Default", "off; --select turns it on"
    if page.get("note"):
        yield "Severity", str(page["note"])
    if page.get("settings"):
        yield "Settings", ", ".join(f"{name} = {wording.setting(value)}" for name, value in page["settings"].items())
    if page.get("exercised"):
        yield "Needs", needs(page["exercised"])
    if page.get("inconclusive"):
        yield "Proof", f"inconclusive without: {', '.join(page['inconclusive'])}"
    if page.get("text"):
        yield "Says", str(page["text"])
    if page.get("episode"):
        yield "Lasting", str(page["episode"])
    if page.get("also"):
        yield "See also", ", ".join(page["also"])


def needs(exercised: str) -> str:
    """Say in words what a capture must hold: `type:A|pair:B>C` is "A or B answered by C"."""
    groups = [part.strip() for part in exercised.split("|")]
    return " or ".join(" and ".join(map(_need, group.split(","))) for group in groups)


def _need(word: str) -> str:
    kind, _, name = word.strip().rpartition(":")
    if kind == "pair":
        return " answered by ".join(name.split(">"))
    if kind == "demand":
        return f"demand of {name} that came due"
    return f"{kind} {name}" if kind not in ("", "type") else name


def _labelled(label: str, text: str, width: int, palette: Palette) -> Iterator[str]:
    start = f"{label:<{_LABEL}}"
    first, *more = wrap(wording.safe(text), width, first=start, indent=" " * _LABEL)
    yield palette.paint("dim", label) + first[len(label) :]
    yield from more
