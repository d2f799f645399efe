"""The gate that a capture has to pass: which findings count, and the exit status that says so."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, cast

from dissectors.keys.pages import CATEGORIES, SEVERITIES
from dissectors.records import dataclass, field

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from dissectors.kit import Severity

DEFAULT = "protocol:error,device:error"
NEVER = "never"
LEAST_TRANSFERS, LEAST_SECONDS = 20, 1.0  # which a capture must have to be judged
CLEAN, FAILED, DAMAGED, NOT_JUDGED = 0, 1, 3, 4
_NAMED = 3
_LEAST = re.compile(r"transfers=(\d{1,9})|seconds=(\d{1,9}(?:\.\d{1,9})?)", re.ASCII)


@dataclass(frozen=True, slots=True)
class FailOn:
    """The least severity that fails, by category; categories that are not named never fail."""

    least: Mapping[str, Severity] = field(default_factory=dict)

    @classmethod
    def parse(cls, texts: Iterable[str]) -> FailOn:
        """Read limits from `protocol:error,device:warning`, or `never`. Raises `ValueError` with what is allowed."""
        words = [word.strip().lower() for text in texts for word in text.split(",")]
        if words == [NEVER]:
            return cls()
        least: dict[str, Severity] = {}
        for word in words:
            category, colon, severity = word.partition(":")
            if not colon or category not in (*CATEGORIES, "any") or severity not in SEVERITIES:
                raise ValueError(
                    f"{word!r} is not CATEGORY:SEVERITY with {', '.join(CATEGORIES)} or any, and "
                    f"{', '.join(SEVERITIES)} (or {NEVER!r} alone)"
                )
            for one in CATEGORIES if category == "any" else (category,):
                least[one] = cast("Severity", max(severity, least.get(one, severity), key=SEVERITIES.index))
        return cls(least)

    @property
    def names(self) -> tuple[str, ...]:
        """As it is written."""
        return tuple(f"{category}:{severity}" for category, severity in sorted(self.least.items())) or (NEVER,)

    @property
    def unlimited(self) -> bool:
        """Return whether nothing fails."""
        return not self.least

    def fails(self, category: str, severity: str) -> bool:
        """Return whether such a finding counts against the gate."""
        least = self.least.get(category)
        return least is not None and SEVERITIES.index(severity) <= SEVERITIES.index(least)


@dataclass(frozen=True, slots=True)
class Least:
    """The least that a capture must have to be judged: complete transfers, and seconds from its first to its last one.

    Below it nothing passes, as there was next to nothing to judge; errors fail all the same.
    """

    transfers: int = LEAST_TRANSFERS
    seconds: float = LEAST_SECONDS

    @classmethod
    def parse(cls, texts: Iterable[str]) -> Least:
        """Read `transfers=20,seconds=1`, any part of it. Raises `ValueError` with what is allowed."""
        least = cls()
        for word in (word.strip() for text in texts for word in text.split(",")):
            given = _LEAST.fullmatch(word)
            if given is None:
                raise ValueError(f"{word!r} is not transfers=N or seconds=N")
            transfers, seconds = given.groups()
            least = cls(int(transfers or least.transfers), float(seconds or least.seconds))
        return least

    def lack(self, transfers: int, seconds: float | None) -> str:
        """Say what there is too little of; empty if there is enough. Without times `seconds` is None and enough."""
        if transfers == 0:
            return "no complete transfer"
        if transfers < self.transfers:
            return f"{transfers} complete transfer{'s' if transfers > 1 else ''}, fewer than {self.transfers}"
        if seconds is not None and seconds < self.seconds:
            return f"{seconds:.3f} s, less than {self.seconds:g} s"
        return ""


@dataclass(frozen=True, slots=True)
class Passage:
    """The end of it: `reason` says why it is not a clean pass."""

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
    """Decide: findings and a vehicle unlike the expected one win over what could not be judged, that over damage.

    Args:
        failing: findings that count.
        unjudged: captures with too little to judge, and what that is.
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
        reasons.append(f"too little to judge: {_few(unjudged)}")
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
