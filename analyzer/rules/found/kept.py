"""The runs that findings are added up in: those of a rule, and those of a key."""

from __future__ import annotations

from bisect import bisect_left
from typing import TYPE_CHECKING

from analyzer.rules.found.runs import closeness

if TYPE_CHECKING:
    from analyzer.rules.catalogue import Page
    from analyzer.rules.found.keys import FindingKey
    from analyzer.rules.found.runs import OccurrenceRun

MOST_BEYOND = 1 << 12


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
    apart. `beyond` are buses, nodes and types of which none is, and none will be.
    """

    __slots__ = ("beyond", "known", "shared")

    def __init__(self, shared: FindingKey) -> None:
        self.shared = shared
        self.known: dict[tuple[int, int, int, str | int], KeyRuns] = {}
        self.beyond: set[tuple[int, ...]] = set()

    def leave_out(self, about: tuple[int, ...]) -> None:
        """Note that nothing of a bus, a node and the number of a type will be kept apart."""
        if len(self.beyond) >= MOST_BEYOND:
            self.beyond.clear()
        self.beyond.add(about)
