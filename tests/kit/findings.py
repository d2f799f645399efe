"""Findings of a report, and what has changed of them, without a capture."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from analyzer.report.model import Finding, Place
from analyzer.report.newest import Change

if TYPE_CHECKING:
    from analyzer.report.model import Severity


def finding(rule: str = "TRF-010", severity: Severity = "error", at: int | None = None, **more: Any) -> Finding:
    """One finding at a time in ns, `more` is what else there is to say of it."""
    place = Place(None, at)
    given: dict[str, Any] = dict.fromkeys(("title", "clause", "capture", "label", "type", "key", "cause"), "")
    given |= {"category": "protocol", "origin": "document", "bus": "can0", "text": "wrong CRC"}
    given |= {"node": None, "count": 1, "first": place, "last": place, "frames": ()} | more
    return Finding(rule=rule, severity=severity, **given)


def change(*what: Any, fresh: bool = True, count: int = 1, **more: Any) -> Change:
    """A finding that is new, or has come up again so often."""
    return Change(finding(*what, **more), fresh, count)
