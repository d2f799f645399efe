"""The runs that findings are added up in: those of a rule, and those of a key."""

from __future__ import annotations

from bisect import bisect_left
from typing import TYPE_CHECKING

from analyzer.rules.found.runs import closeness

if TYPE_CHECKING:
    from analyzer.rules.catalogue import Page
    from analyzer.rules.found.keys import FindingKey
    from analyzer.rules.found.runs import OccurrenceRun

MOST_BEYOND = 1 << 16


class RuleRuns:
    """The runs of a rule: how many there are, and what makes one of two.

    `plain`: no part of them may be explained, or explains another one's. `crowded`: there are so many that an
    occurrence joins the run of its key before it, whatever the pause between.
    """

    __slots__ = ("close", "count", "crowded", "page", "plain")

    def __init__(self, page: Page, *, plain: bool) -> None:
        self.page, self.plain = page, plain
        self.close = closeness(page)
        self.count = 0
        self.crowded = False


class KeyRuns:
    """The runs of a key, in order of time; `changed` if something was added since somebody asked."""

    __slots__ = ("changed", "key", "rule", "runs", "spot")

    def __init__(self, key: FindingKey, rule: RuleRuns) -> None:
        self.key, self.rule, self.spot = key, rule, key.spot
        self.runs: list[OccurrenceRun] = []
        self.changed = False

    def before(self, place: tuple[int, int]) -> OccurrenceRun | None:
        """Return the last run that began before a place."""
        runs = self.runs
        if not runs:
            return None
        at = len(runs) if runs[-1].first < place else bisect_left(runs, place, key=lambda one: one.first)
        return runs[at - 1] if at else None


class AlikeRuns:
    """The runs of occurrences that are alike but for bus, node, type and key.

    `shared` is the key of what comes when no more keys are kept apart, `known` has those that are, by what tells them
    apart.

    Args:
        shared: a key.
        beyond: buses, nodes and types of which none is, and none will be: of all kinds together, as one number each.
        kind: a number for these occurrences, other than for others.
    """

    __slots__ = ("_beyond", "_kind", "known", "shared")

    def __init__(self, shared: FindingKey, beyond: set[int], kind: int) -> None:
        self.shared = shared
        self.known: dict[tuple[int, int, int, str | int], KeyRuns] = {}
        self._beyond, self._kind = beyond, kind

    def is_beyond(self, about: tuple[int, int, int, int]) -> bool:
        """Return whether it is known that nothing of a bus, a node and the number of a type will be kept apart."""
        return self._number(about) in self._beyond

    def leave_out(self, about: tuple[int, int, int, int]) -> None:
        """Note that nothing of a bus, a node and the number of a type will be kept apart."""
        if len(self._beyond) >= MOST_BEYOND:
            self._beyond.clear()
        self._beyond.add(self._number(about))

    def _number(self, about: tuple[int, int, int, int]) -> int:
        bus, node, type_, _ = about
        return ((self._kind << 9 | bus + 1) << 8 | node + 1) << 33 | type_ + 1  # each may be -1
