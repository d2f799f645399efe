"""Triage as Markdown: for comments, tickets and job summaries."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.report.triage.words import TriageWords, odd_who

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analyzer.flight.verdict.model import Triage

_MOST_AFTER = 10


def render(found: Triage) -> str:
    """Return the verdict, why, and what came after it."""
    words, one = TriageWords(found), found.first
    lines = [f"### {_safe(one.title)}" + (f" ({one.support})" if one.told else ""), ""]
    lines.append(f"{', '.join(f'`{_code(name)}`' for name in found.captures)}, {words.span(found)}")
    if when := words.when(one):
        lines += ["", f"**At** {when}"]
    for label, texts in _parts(found, words):
        if texts:
            lines += ["", f"**{label}**", "", *(f"- {_safe(text)}" for text in texts)]
    if found.not_seen:
        lines += ["", f"Not on CAN: {', '.join(found.not_seen)}."]
    return "\n".join(lines) + "\n"


def _parts(found: Triage, words: TriageWords) -> Iterator[tuple[str, Sequence[str]]]:
    one = found.first
    yield "Seen", [f"{label}: {text}" for label, text in one.notes]
    yield "For", one.reasons
    yield "Against", one.against
    yield "Ruled out", [f"{excluded.fact}: {excluded.seen}" for excluded in found.excluded]
    yield "Autopilot", [f"{words.time(x.first.t)} {x.kind}: {x.text}" for x in found.said]
    yield "Odd", [*(f"{odd_who(x)}: {x.text}" for x in found.odd_before), *found.facts]
    yield "After it", [f"{words.time(x.first.t)} {x.kind}: {x.text}" for x in found.after[:_MOST_AFTER]]
    yield "Recording", [f"{label}: {text}" for label, text in found.lines]


def _safe(text: str) -> str:
    """Return a text of a capture that makes no Markdown and no HTML."""
    shown = "".join(c if c.isprintable() else " " for c in text)
    return "".join(f"\\{c}" if c in "\\`*_[]<>|#~" else c for c in shown).replace("&", "&amp;")


def _code(text: str) -> str:
    """Return a text that stays inside a code span."""
    return "".join(c if c.isprintable() and c != "`" else "?" for c in text)
