"""Occurrences to findings: what one node does wrong again and again is one line, with its first and last time.

The result does not depend on the order in which occurrences come in, as long as no bound is reached.
"""

from __future__ import annotations

from bisect import bisect_left
from typing import TYPE_CHECKING, Any, NamedTuple

from analyzer.rules.found.episodes import episode_of
from analyzer.rules.found.groups import all_one, by_pause, by_piece, by_place, pieces_by_key, split
from analyzer.rules.found.keys import FURTHER, FindingKey, RuleAt, Spot
from analyzer.rules.found.runs import (
    MOST_EXAMPLES,
    RICH,
    OccurrenceRun,
    Shown,
    absorb,
    closeness,
    is_full,
    joined,
    merge,
)
from dissectors.kit import Occurrence, Occurrences
from dissectors.kit.occurrence import TURNED

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from analyzer.rules.catalogue import Page
    from dissectors.kit import Severity, View

MOST_PIECES = 24  # of a run that may be explained in parts; of more, those long past that are alike are put together
MOST_GROUPS = 4096  # of rule, node, type and key; what comes later is one finding a rule
KEPT = 4 * RICH  # runs that may have all their examples until it is known which ones are the first
MOST_APART = 1024  # runs of one rule; from then on a pause ends none where nothing is explained by a part


class _Told(NamedTuple):
    """Occurrences of one rule, and what makes examples of them."""

    found: Occurrences
    page: Page
    view: View

    def place(self, row: int) -> tuple[int, int]:
        """Return the place of one."""
        return self.found.t.item(row), self.found.frame.item(row)

    def example(self, row: int) -> Shown:
        """Return one to show."""
        found = self.found
        values, frames = found.values(row), tuple(found.frames(row))
        lines = self.view.lines(frames) if found.lines is None else found.lines(row)
        return Shown(*self.place(row), self.page.say(values), str(values.get("cause", "")), frames, lines)


class Findings:
    """Adds up occurrences by rule, bus, node, type and key.

    Args:
        pages: the pages of the rules that are looked for; anything else is left out.
        severities: severities that stand instead of those of pages and occurrences.
    """

    def __init__(self, pages: Mapping[str, Page], severities: Mapping[str, Severity]) -> None:
        self._pages = pages
        self._severities = severities
        self.runs: dict[FindingKey, list[OccurrenceRun]] = {}
        self.spots: dict[Spot, list[FindingKey]] = {}
        self.keys: dict[RuleAt, list[FindingKey]] = {}
        self._changed: set[Spot] = set()
        causes = {rule for page in pages.values() for rule in page.explained}
        self._plain = {rule for rule, page in pages.items() if not page.explained} - causes
        self._counts: dict[str, int] = {}  # runs of rules
        self._total = 0  # and of all
        self.changes = 0  # how often something was added

    def feed(self, found: Occurrences | Occurrence, view: View, *, near_drops: Sequence[bool] | None = None) -> None:
        """Add occurrences of one rule; `near_drops` marks those that lost frames may explain."""
        if found.rule not in self._pages:
            return
        if isinstance(found, Occurrence):
            self._add_one(found, view, bool(near_drops and near_drops[0]))
        elif len(found.t):
            self._add_many(found, view, near_drops)

    def take_changed(self) -> set[Spot]:
        """Return the spots where something was added since the last call."""
        changed, self._changed = self._changed, set()
        return changed

    def _add_one(self, one: Occurrence, view: View, near_drops: bool) -> None:
        page = self._pages[one.rule]
        key = FindingKey(
            one.rule, self._severity(one.rule, one.severity, near_drops), one.bus, -1 if one.node is None else one.node,
            one.type, page.key_of(one.values), tuple(one.dialects.items()),
        )  # fmt: skip
        key = key if self._has_room(key) else key._replace(bus=-1, node=-1, type="", key=FURTHER)
        place = (one.t, one.frames[0] if one.frames else -1)
        if self._is_counted(key, place, place, 1):
            return
        run = OccurrenceRun(place, place, 1)
        if self._room(key, run, sparse=False):
            cause = str(one.values.get("cause", ""))
            lines = one.lines or view.lines(one.frames)
            run.examples = [Shown(*place, page.say(one.values), cause, tuple(one.frames), lines)]
        self._put(key, run)

    def _add_many(self, found: Occurrences, view: View, near_drops: Sequence[bool] | None) -> None:
        page = self._pages[found.rule]
        further: dict[tuple[bool, bool], list[Any]] = {}
        full = len(self.runs) >= MOST_GROUPS
        told, shared = _Told(found, page, view), dict[tuple[bool, bool], FindingKey]()
        apart = by_piece if page.explained else all_one if self._is_crowded(found.rule) else by_pause
        placed: list[tuple[FindingKey, Any]] = []
        for pieces, noted, doubtful, bus, node, number in pieces_by_key(found, near_drops, apart):
            if (noted, doubtful) not in shared:
                shared[noted, doubtful] = self._shared_key(found, noted, doubtful)
            last, type_ = shared[noted, doubtful], view.type_name(number)
            if not full or Spot(found.rule, bus, node, type_) in self.spots:
                named = page.key_of(found.values(pieces[0].item(0))) if page.key else ""
                key = FindingKey(last.rule, last.severity, bus, node, type_, named, last.dialects)
                if self._has_room(key):
                    self._runs_of(key)
                    placed += ((key, piece) for piece in pieces)
                    continue
            further.setdefault((noted, doubtful), []).extend(pieces)
        for of, parts in further.items():
            rows = by_place(found, parts)
            placed += ((shared[of], piece) for piece in split(rows, apart(found.t[rows])))
        if found.rule in self._plain and 0 <= MOST_APART - self._counts.get(found.rule, 0) < len(placed):
            placed.sort(key=lambda one: told.place(one[1].item(0)))  # which ones are the last to stand apart
        for key, piece in placed:
            self._add_rows(key, told, piece)

    def _add_rows(self, key: FindingKey, told: _Told, rows: Any) -> None:
        """Add occurrences of one key that are in one run."""
        found, first = told.found, told.place(rows.item(0))
        last = first if len(rows) == 1 else told.place(rows.item(-1))
        if not found.worst and self._is_counted(key, first, last, len(rows)):
            return
        run = OccurrenceRun(first, last, len(rows), episode=episode_of(found, rows))
        room = self._room(key, run, sparse=key.key != FURTHER and found.lines is None)
        if room:
            if run.episode is not None:
                run.episode.onset = found.values(rows.item(0))
            run.examples = [told.example(row) for row in rows[:room].tolist()]
        self._put(key, run)

    def _shared_key(self, found: Occurrences, noted: bool, doubtful: bool) -> FindingKey:
        """Return the key that what comes later shares; `doubtful`: its values may be those of another reading."""
        severity = self._severity(found.rule, found.severity, noted)
        dialects = (*found.dialects.items(), *(TURNED.items() if doubtful else ()))
        return FindingKey(found.rule, severity, -1, -1, "", FURTHER, dialects)

    def _is_counted(self, key: FindingKey, first: tuple[int, int], last: tuple[int, int], count: int) -> bool:
        """Return whether occurrences go on with a run that has all its examples, and count them there then."""
        run = self._before(key, first)
        if run is None or run.episode is not None:
            return False
        goes_on = is_full(run, first)
        if last > run.last:
            goes_on = self._is_crowded(key.rule) or (goes_on and closeness(self._pages[key.rule])(run, first))
            goes_on = goes_on and run is self.runs[key][-1]  # else they may join the run behind it, too
        if not goes_on:
            return False
        run.last = max(run.last, last)
        run.count += count
        self._mark(key)
        return True

    def _before(self, key: FindingKey, place: tuple[int, int]) -> OccurrenceRun | None:
        """Return the last run of a key that began before a place."""
        runs = self.runs.get(key)
        if not runs:
            return None
        at = len(runs) if runs[-1].first < place else bisect_left(runs, place, key=lambda one: one.first)
        return runs[at - 1] if at else None

    def _room(self, key: FindingKey, run: OccurrenceRun, *, sparse: bool) -> int:
        """Return how many examples of a run may be shown: it may go on with one that has some, or all it may have.

        Of those that are `sparse`, runs beyond `KEPT` have one.
        """
        before = self._before(key, run.first)
        crowded = before is not None and self._is_crowded(key.rule)
        if before is None or not (crowded or closeness(self._pages[key.rule])(before, run.first)):
            run.most = 1 if sparse and self._total >= KEPT else MOST_EXAMPLES
            return run.most
        run.most = 0
        if crowded or is_full(before, run.first):
            return 0
        return before.most - len(before.examples) if before.last < run.first else before.most

    def _is_crowded(self, rule: str) -> bool:
        """Return whether an occurrence joins the run of its key before it, whatever the pause between."""
        return rule in self._plain and self._counts.get(rule, 0) >= MOST_APART

    def _severity(self, rule: str, said: Severity | None, near_drops: bool) -> Severity:
        if rule in self._severities:
            return self._severities[rule]
        return "note" if near_drops else said or self._pages[rule].severity

    def _has_room(self, key: FindingKey) -> bool:
        """Return whether occurrences of a key are kept apart: those beyond `MOST_GROUPS` share one."""
        return key in self.runs or len(self.runs) < MOST_GROUPS

    def _runs_of(self, key: FindingKey) -> list[OccurrenceRun]:
        """Return the runs of a key, which has its place from now on."""
        runs = self.runs.get(key)
        if runs is None:
            runs = self.runs[key] = []
            self.spots.setdefault(key.spot, []).append(key)
            self.keys.setdefault(key.spot.where, []).append(key)
        return runs

    def _put(self, key: FindingKey, run: OccurrenceRun) -> None:
        runs = self._runs_of(key)
        before = len(runs)
        page = self._pages[key.rule]
        if runs and self._is_crowded(key.rule):
            absorb(runs, run)
        else:
            merge(runs, run, closeness(page))
        if page.explained and len(runs) > MOST_PIECES:
            others = (one for rule in page.explained for one in self.keys.get(RuleAt(rule, key.bus, key.node), ()))
            runs[:] = joined(runs, [run for one in others for run in self.runs[one]])
        self._counts[key.rule] = self._counts.get(key.rule, 0) + len(runs) - before
        self._total += len(runs) - before
        self._mark(key)

    def _mark(self, key: FindingKey) -> None:
        """Note that something was added."""
        self.changes += 1
        self._changed.add(key.spot)
