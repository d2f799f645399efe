"""Findings that somebody waits for, as `-a finding:` and `--trigger` name them: `error`, `TRF-010`."""

from __future__ import annotations

import difflib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable

SEVERITIES = ("error", "warning", "note")
CATEGORIES = ("protocol", "device", "capture")


class Place(Protocol):
    """When something was; None if nobody knows."""

    @property
    def t_ns(self) -> int | None:
        """Nanoseconds since 1970."""


class Finding(Protocol):
    """What is looked at of a finding of the report."""

    @property
    def rule(self) -> str:
        """Such as `TRF-010`."""

    @property
    def severity(self) -> str:
        """One of `SEVERITIES`."""

    @property
    def category(self) -> str:
        """One of `CATEGORIES`."""

    @property
    def bus(self) -> str:
        """Where it was; empty if on no bus."""

    @property
    def text(self) -> str:
        """What is wrong; raw, as it may come from the bus."""

    @property
    def last(self) -> Place:
        """When it occurred last."""

    @property
    def excused(self) -> str:
        """Why it does not count; empty if it does."""


class Change(Protocol):
    """A finding that is new, or has come up again."""

    @property
    def finding(self) -> Finding:
        """As it is now."""

    @property
    def fresh(self) -> bool:
        """Whether it is new."""


@dataclass(frozen=True, slots=True)
class Wanted:
    """Findings of at least a severity, maybe of one category, or of a rule or a layer of rules."""

    severity: str = ""
    category: str = ""
    rule: str = ""

    def meets(self, finding: Finding) -> bool:
        """Whether that is one of them; what is excused is none."""
        if finding.excused:
            return False
        if self.rule:
            return self.rule in {finding.rule, finding.rule.partition("-")[0]}
        bad_enough = SEVERITIES.index(finding.severity) <= SEVERITIES.index(self.severity)
        return bad_enough and self.category in {"", finding.category}


def parse_wanted(option: str, text: str, rules: Collection[str]) -> Wanted:
    """`error` (at least), `protocol:error`, `TRF-010` or `TRF`, one of `rules`. Raises `ValueError`."""
    category, _, severity = text.rpartition(":")
    if severity in SEVERITIES and category in {"", *CATEGORIES}:
        return Wanted(severity, category)
    known = {*rules, *(rule.partition("-")[0] for rule in rules)}
    if text.upper() in known:
        return Wanted(rule=text.upper())
    near = difflib.get_close_matches(text.upper(), sorted(known), n=3) or difflib.get_close_matches(text, SEVERITIES)
    hint = f"did you mean {', '.join(near)}" if near else "give error, warning, note, a rule or its first letters"
    raise ValueError(f"{option} {text}: no such rule ({hint})")


def first_met(wanted: Iterable[Wanted], changes: Iterable[Change]) -> Finding | None:
    """The first finding that somebody waits for."""
    patterns = tuple(wanted)
    return next((c.finding for c in changes if any(one.meets(c.finding) for one in patterns)), None)
