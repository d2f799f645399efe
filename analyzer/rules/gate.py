"""What a capture has to pass: which findings count, and the exit status that says so."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, cast, get_args

from analyzer.rules.catalogue import CATEGORIES
from dissectors.conformance import Severity

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

DEFAULT = "protocol:error"
NEVER = "never"
CLEAN, FAILED, DAMAGED, NOT_JUDGED = 0, 1, 3, 4
_SEVERITIES: tuple[str, ...] = get_args(Severity)  # the worst first
_NAMED = 3


@dataclass(frozen=True, slots=True)
class FailOn:
    """The least severity that fails, by category; categories that are not named never fail."""

    least: Mapping[str, Severity] = field(default_factory=dict)

    @classmethod
    def parse(cls, texts: Iterable[str]) -> FailOn:
        """From `protocol:error,device:warning`, or `never`. Raises `ValueError` with what is allowed."""
        words = [word.strip().lower() for text in texts for word in text.split(",")]
        if words == [NEVER]:
            return cls()
        least: dict[str, Severity] = {}
        for word in words:
            category, colon, severity = word.partition(":")
            if not colon or category not in (*CATEGORIES, "any") or severity not in _SEVERITIES:
                raise ValueError(
                    f"{word!r} is not CATEGORY:SEVERITY with {', '.join(CATEGORIES)} or any, and "
                    f"{', '.join(_SEVERITIES)} (or {NEVER!r} alone)"
                )
            for one in CATEGORIES if category == "any" else (category,):
                least[one] = cast("Severity", max(severity, least.get(one, severity), key=_SEVERITIES.index))
        return cls(least)

    @property
    def names(self) -> tuple[str, ...]:
        """As it is written."""
        return tuple(f"{category}:{severity}" for category, severity in sorted(self.least.items())) or (NEVER,)

    @property
    def unlimited(self) -> bool:
        """Whether nothing fails."""
        return not self.least

    def fails(self, category: str, severity: str) -> bool:
        """Whether such a finding counts against the gate."""
        least = self.least.get(category)
        return least is not None and _SEVERITIES.index(severity) <= _SEVERITIES.index(least)


@dataclass(frozen=True, slots=True)
class Passage:
    """How it ended: `reason` says why it is not a clean pass."""

    failed: bool
    judged: bool
    exit_status: int
    reason: str


def passage(
    failing: int,
    unjudged: Sequence[str],
    unmet: Sequence[str],
    damaged: Sequence[str],
    unproven: Sequence[str] = (),
    missed: Sequence[str] = (),
) -> Passage:
    """Findings and a vehicle unlike the expected one win over what could not be judged, that over damage.

    Args:
        failing: findings that count.
        unjudged: captures with nothing to judge.
        unmet: demands that are not met.
        damaged: captures that could not be read as a whole.
        unproven: the selected rules, each with the reason, if not one of them could be judged.
        missed: what was expected of the vehicle and is not so, if that counts.
    """
    reasons = []
    if failing:
        reasons.append(f"{failing} finding{'s' if failing > 1 else ''} at or above the limit")
    if missed:
        reasons.append(f"expected but not met: {_few(missed)}")
    if unmet:
        reasons.append(f"required but not met: {_few(unmet)}")
    if unjudged:
        reasons.append(f"nothing to judge in {_few(unjudged)}")
    if unproven:
        reasons.append(f"no selected rule could be judged: {_few(unproven)}")
    if damaged:
        reasons.append(f"not read as a whole: {_few(damaged)}")
    judged = not unjudged and not unmet and not unproven
    failed = failing > 0 or len(missed) > 0
    status = FAILED if failed else NOT_JUDGED if not judged else DAMAGED if damaged else CLEAN
    return Passage(failed, judged, status, "; ".join(reasons))


def _few(names: Sequence[str]) -> str:
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return ", ".join(names[:_NAMED]) + more
