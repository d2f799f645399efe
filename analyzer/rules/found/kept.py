"""The runs that findings are added up in: those of a rule, and those of a key."""

from __future__ import annotations

from bisect import bisect_left
from typing import TYPE_CHECKING, NamedTuple

from analyzer.rules.found.runs import closeness

if TYPE_CHECKING:
    from analyzer._native import LastRuns
    from analyzer.rules.catalogue import Page
    from analyzer.rules.found.keys import FindingKey
    from analyzer.rules.found.runs import OccurrenceRun


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
    """The runs of a key, in order of time; `changed` if something was added since somebody asked.

    The core counts, in `last_runs`, what goes on with the last one, if this is `counted` there.
    """

    __slots__ = ("_last_runs", "_runs", "changed", "counted", "key", "number", "rule", "spot")

    def __init__(self, key: FindingKey, rule: RuleRuns, last_runs: LastRuns) -> None:
        self.key, self.rule, self.spot = key, rule, key.spot
        self.number = last_runs.add()
        self.counted = self.changed = False
        self._last_runs = last_runs
        self._runs: list[OccurrenceRun] = []

    @property
    def runs(self) -> list[OccurrenceRun]:
        """The runs with all that was counted."""
        more = self._last_runs.take(self.number) if self.counted else None
        if more is not None:
            run = self._runs[-1]
            run.count += more[0]
            run.last = more[1]
        return self._runs

    def know(self, alike: int, about: tuple[int, int, int, int]) -> None:
        """Have the core count what is `alike` and of a bus, a node, and the numbers of a type and of a key."""
        self.counted = True
        self._last_runs.know(alike, about, self.number)

    def tell(self) -> None:
        """Tell the core what the last run is now."""
        if self.counted:
            run = self._runs[-1]
            full = run.examples[-1][:2] if len(run.examples) == run.most else None
            self._last_runs.tell(self.number, None if run.episode is not None else (run.first, run.last, full))

    def before(self, place: tuple[int, int]) -> OccurrenceRun | None:
        """Return the last run that began before a place."""
        runs = self.runs
        if not runs:
            return None
        at = len(runs) if runs[-1].first < place else bisect_left(runs, place, key=lambda one: one.first)
        return runs[at - 1] if at else None


class AlikeRuns(NamedTuple):
    """The runs of occurrences that are alike but for bus, node, type and key.

    `number` is theirs alone, `shared` the key of what comes when no more keys are kept apart.
    """

    number: int
    shared: FindingKey
