"""Triage as one HTML file in the look of the report: no network, no script, everything escaped."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.report.html.parts import environment, policy
from analyzer.report.html.triage import section

if TYPE_CHECKING:
    from analyzer.flight.verdict.model import Triage

_TONES = {"bad": "bad", "good": "good", "open": "idle"}


def render(found: Triage) -> str:
    """Write the whole file. The same answer gives the same text."""
    templates = environment(__package__)
    one = section(found)
    return templates.get_template("page.html.j2").render(one=one, policy=policy(templates), tone=_TONES[one["tone"]])
