"""The differences as one HTML file in the look of the report: no network, no script, everything escaped."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.report.comparison.model import KINDS
from analyzer.report.comparison.rows import earliest, evidence, headline, name, rows, tone
from analyzer.report.html.parts import environment, policy
from analyzer.report.wording import length

if TYPE_CHECKING:
    from analyzer.report.comparison.model import CaptureDiff, Side

MOST_ROWS = 5000


def render(of: CaptureDiff) -> str:
    """Write the whole file. The same comparison gives the same text."""
    from analyzer.report.comparison.limits import table  # noqa: PLC0415 - TOML is read for it

    templates = environment(__package__)
    word, summary = headline(of)
    return templates.get_template("diff.html.j2").render(
        of=of,
        policy=policy(templates),
        word=word,
        summary=summary,
        tone=tone(of),
        first=earliest(of),
        sides=[("Good", of.good, _length(of.good)), ("Bad", of.bad, _length(of.bad))],
        rows=rows(of.differences)[:MOST_ROWS],
        every=[
            (kind, some) for kind in KINDS if (some := [one for one in of.differences if one.kind == kind][:MOST_ROWS])
        ],
        name=name,
        evidence=evidence,
        limits=table(),
        moved=[one for one in of.matched if (one.bus, one.node) != (one.bad_bus, one.bad_node)],
    )


def _length(side: Side) -> str:
    if side.start_ns is None or side.end_ns is None:
        return "no times"
    return length(side.end_ns - side.start_ns)
