"""Occurrences to findings: what one node does wrong again and again is one line, with its first and last time.

The result does not depend on the order in which occurrences come in, as long as no bound is reached.
"""

from __future__ import annotations

from bisect import insort
from sys import intern
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer._native import LastRuns
from analyzer.rules.found.episodes import episode_of
from analyzer.rules.found.groups import ALL_ONE, BY_PAUSE, BY_PIECE, groups_of
from analyzer.rules.found.kept import AlikeRuns, KeyRuns, RuleRuns
from analyzer.rules.found.keys import FURTHER, FindingKey, RuleAt, Spot
from analyzer.rules.found.runs import MOST_EXAMPLES, RICH, OccurrenceRun, Shown, absorb, is_full, joined, merge
from dissectors.kit import Occurrence, Occurrences
from dissectors.kit.occurrence import TURNED

if TYPE_CHECKING:
    from collections.abc import Mapping

    from analyzer._native import OccurrenceGroups
    from analyzer.rules.catalogue import Page
    from analyzer.rules.found.groups import Apart, Piece
    from dissectors.kit import Array, Severity, View

MOST_PIECES = 24  # of a run that may be explained in parts; of more, those long past that are alike are put together
MOST_GROUPS = 4096  # of rule, node, type and key; what comes later is one finding a rule
KEPT = 4 * RICH  # runs that may have all their examples until it is known which ones are the first
MOST_APART = 1024  # runs of one rule; from then on a pause ends none where nothing is explained by a part
MOST_BEYOND = 1 << 12  # of a kind of occurrences: what is known to have no key of its own
_UNKNOWN = -1  # number of a key by which nothing is kept apart yet


class _Told(NamedTuple):
    """Occurrences of one rule, and what makes examples of them."""

    found: Occurrences
    page: Page
    view: View
    groups: OccurrenceGroups
    names: dict[int, str]  # of rows, as far as they were asked for

    @property
    def numbered(self) -> bool:
        """True if the same number keeps findings apart in every batch."""
        return self.found.lasts or (self.found.key is None and not self.page.key)

    def name(self, row: int) -> str:
        """Return the key of a row."""
        if not self.page.key:
            return ""
        name = self.names.get(row)
        if name is None:
            name = self.names[row] = self.page.key_of((self.found.key_values or self.found.values)(row))
        return name

    def example(self, row: int) -> Shown:
        """Return one to show."""
        found = self.found
        values, frames = found.values(row), tuple(found.frames(row))
        lines = self.view.lines(frames) if found.lines is None else found.lines(row)
        place = found.t.item(row), found.frame.item(row)
        text = self.page.say(values)
        if type(text) is str:
            text = intern(text)  # thousands say the same
        return Shown(*place, text, str(values.get("cause", "")), frames, lines)


class Findings:
    """Adds up occurrences by rule, bus, node, type and key.

    Args:
        pages: the pages of the rules that are looked for; anything else is left out.
        severities: severities that stand instead of those of pages and occurrences.
    """

    def __init__(self, pages: Mapping[str, Page], severities: Mapping[str, Severity]) -> None:
        self._pages = pages
        self._severities = severities
        self.spots: dict[Spot, list[FindingKey]] = {}
        self.keys: dict[RuleAt, list[FindingKey]] = {}
        causes = {rule for page in pages.values() for rule in page.explained}
        self._rules = {
            rule: RuleRuns(page, plain=not page.explained and rule not in causes) for rule, page in pages.items()
        }
        self.kept: dict[FindingKey, KeyRuns] = {}
        self._key_names: set[str] = set()  # of those that are kept
        self._numbered: list[KeyRuns] = []  # the same by their numbers
        self._last_runs = LastRuns(MOST_BEYOND)
        self._names: dict[str, int] = {}  # a number for each key by which something is kept apart
        self._alike: dict[tuple[object, ...], tuple[AlikeRuns, ...]] = {}
        self._changed: list[KeyRuns] = []
        self._total = 0  # runs of all rules
        self._added = 0

    @property
    def changes(self) -> int:
        """How often something was added."""
        return self._added + self._last_runs.counted

    def feed(self, found: Occurrences | Occurrence, view: View, *, near_drops: Array | None = None) -> None:
        """Add occurrences of one rule; `near_drops` is a mask of those that lost frames may explain."""
        if found.rule not in self._pages:
            return
        if isinstance(found, Occurrence):
            self._add_one(found, view, near_drops is not None and bool(near_drops[0]))
        elif len(found.t):
            self._add_many(found, view, near_drops)

    def take_changed(self) -> set[Spot]:
        """Return the spots where something was added since the last call."""
        changed, self._changed = self._changed, []
        for kept in changed:
            kept.changed = False
        return {kept.spot for kept in (*changed, *map(self._numbered.__getitem__, self._last_runs.take_changed()))}

    def _add_one(self, one: Occurrence, view: View, near_drops: bool) -> None:
        page = self._pages[one.rule]
        key = FindingKey(
            one.rule, self._severity(one.rule, one.severity, near_drops), one.bus, -1 if one.node is None else one.node,
            one.type, page.key_of(one.values), tuple(one.dialects.items()),
        )  # fmt: skip
        kept = self._apart(key) or self._kept_of(_shared(key.rule, key.severity, key.dialects))
        place = (one.t, one.frames[0] if one.frames else -1)
        room = self._counted(kept, place, place, 1)
        run = kept.runs[-1] if room else OccurrenceRun(place, place, 1)
        new = room is None
        if new:
            room = self._room(kept, run, sparse=False)
        if room:
            cause = str(one.values.get("cause", ""))
            lines = one.lines or view.lines(one.frames)
            insort(run.examples, Shown(*place, page.say(one.values), cause, tuple(one.frames), lines))
        if new:
            self._put(kept, run)
        kept.tell()

    def _add_many(self, found: Occurrences, view: View, near_drops: Array | None) -> None:
        rule = self._rules[found.rule]
        ends = BY_PIECE if rule.page.explained else BY_PAUSE
        told = _Told(found, rule.page, view, groups_of(found, near_drops, ALL_ONE if rule.crowded else ends), {})
        # Which ones are the last to stand apart goes by time; what goes on with a run without a pause does so anyway.
        few_left = rule.plain and 0 <= MOST_APART - rule.count < len(found.t)
        placed = self._placed(told, None if found.worst else (ends, rule.crowded and not few_left))
        if few_left and MOST_APART - rule.count < len(placed):
            placed.sort(key=lambda one: one[1][0])
        for kept, piece in placed:
            first, last, begin, end = piece
            room = None if found.worst else self._counted(kept, first, last, end - begin)
            if room is None:
                self._add_rows(kept, told, piece)
            elif room:
                for row in told.groups.rows(begin, min(begin + room, end)):
                    insort(kept.runs[-1].examples, told.example(row))
            kept.tell()

    def _placed(self, told: _Told, joins: tuple[Apart, bool] | None) -> list[tuple[KeyRuns, Piece]]:
        """Return the pieces of occurrences, each with the runs of its key; those that share a key come last.

        What the core can count goes on with a last run, as `joins` say, and is left out.
        """
        groups, alike = told.groups, self._alike_of(told.found)
        keys = self._keys(told, alike[0].number)
        left, beyond = self._last_runs.count(groups, alike[0].number, keys, joins)
        placed: list[tuple[KeyRuns, Piece]] = []
        for at, number, pieces in left:
            if number is not None:
                placed += [(self._numbered[number], piece) for piece in pieces]
                continue
            (noted, doubtful), about, row = groups.group(at)
            kind = 2 * noted + doubtful
            kept = self._kept_apart(told, alike[kind], about, row)
            if kept is None:
                insort(beyond[kind], at)
            else:
                placed += [(kept, piece) for piece in pieces]
        further = [(some, kind) for kind, some in enumerate(beyond) if some]
        for some, kind in sorted(further):  # as they come
            kept = self._kept_of(alike[kind].shared)
            kept.counted = True
            sure = None if joins is None else (joins[0], joins[1] and not placed)  # what is left may end the crowd
            placed += [(kept, piece) for piece in self._last_runs.count_together(groups, some, kept.number, sure)]
        return placed

    def _keys(self, told: _Told, alike: int) -> list[int] | None:
        """Return numbers for the keys of groups; None if these have some that are the same in every batch."""
        if told.numbered:
            return None
        known: dict[int, int] = {}
        keys: list[int] = []
        for one in self._last_runs.keys(told.groups, alike):
            number = _UNKNOWN if one is None else known.get(one[0])
            if one is not None and number is None:
                number = self._names.get(told.name(one[1]), _UNKNOWN)
                if told.found.key is not None:
                    known[one[0]] = number
            keys.append(_UNKNOWN if number is None else number)
        return keys

    def _add_rows(self, kept: KeyRuns, told: _Told, piece: Piece) -> None:
        """Add occurrences of one key that are in one run, and not counted in another one."""
        found, (first, last, begin, end) = told.found, piece
        run = OccurrenceRun(first, last, end - begin)
        if found.worst:
            run.episode = episode_of(found, np.array(told.groups.rows(begin, end)))
        room = self._room(kept, run, sparse=kept.key.key != FURTHER and found.lines is None)
        if room:
            rows = told.groups.rows(begin, min(begin + room, end))
            if run.episode is not None:
                run.episode.onset = found.values(rows[0])
            run.examples = [told.example(row) for row in rows]
        self._put(kept, run)

    def _kept_apart(self, told: _Told, alike: AlikeRuns, about: tuple[int, int, int, int], row: int) -> KeyRuns | None:
        """Return the runs of a bus, a node, the number of a type, and the key of a row; None if there is no room."""
        (bus, node, number, _), shared = about, alike.shared
        full, keyed = len(self.kept) >= MOST_GROUPS, told.page.key
        if full and keyed and Spot(shared.rule, bus, node, told.view.type_name(number)) not in self.spots:
            self._last_runs.leave_out(alike.number, about[:3])
            return None
        named = told.name(row)
        if full and keyed and named not in self._key_names:
            return None
        type_ = told.view.type_name(number)
        kept = self._apart(FindingKey(shared.rule, shared.severity, bus, node, type_, named, shared.dialects))
        if kept is not None:
            key = about[3] if told.numbered else self._names.setdefault(named, len(self._names))
            kept.know(alike.number, (bus, node, number, key))
        elif not keyed:
            self._last_runs.leave_out(alike.number, about[:3])
        return kept

    def _alike_of(self, found: Occurrences) -> tuple[AlikeRuns, ...]:
        """Return the runs of such occurrences: plain ones, doubtful ones, and those of which lost frames are the cause.

        The values of doubtful ones may be those of another reading.
        """
        dialects = tuple(found.dialects.items())
        kind = found.rule, found.severity, dialects, found.lasts
        alike = self._alike.get(kind)
        if alike is None:
            begin = 4 * len(self._alike)
            turned = dialects + tuple(TURNED.items())
            shared = [
                _shared(found.rule, self._severity(found.rule, found.severity, noted), one)
                for noted in (False, True)
                for one in (dialects, turned)
            ]
            alike = self._alike[kind] = tuple(AlikeRuns(begin + at, one) for at, one in enumerate(shared))
        return alike

    def _counted(self, kept: KeyRuns, first: tuple[int, int], last: tuple[int, int], count: int) -> int | None:
        """Count occurrences that go on with a run, and return how many examples of them the last run wants then.

        None if they are a run of their own, or join one that has examples behind them.
        """
        runs, rule = kept.runs, kept.rule
        run = runs[-1] if runs and runs[-1].first < first else kept.before(first)
        if run is None or run.episode is not None:
            return None
        goes_on = is_full(run, first)
        if last > run.last:
            goes_on = goes_on or (run.last < first and not (rule.page.explained and len(runs) > MOST_PIECES))
            goes_on = rule.crowded or (goes_on and rule.close(run, first))
            goes_on = goes_on and run is runs[-1]  # else they may join the run behind it, too
            if goes_on:
                run.last = last
        if not goes_on:
            return None
        run.count += count
        self._mark(kept)
        return 0 if rule.crowded else run.most - len(run.examples)

    def _room(self, kept: KeyRuns, run: OccurrenceRun, *, sparse: bool) -> int:
        """Return how many examples of a run may be shown: it may go on with one that has some, or all it may have.

        Of those that are `sparse`, runs beyond `KEPT` have one.
        """
        before = kept.before(run.first)
        crowded = before is not None and kept.rule.crowded
        if before is None or not (crowded or kept.rule.close(before, run.first)):
            run.most = 1 if sparse and self._total >= KEPT else MOST_EXAMPLES
            return run.most
        run.most = 0
        if crowded or is_full(before, run.first):
            return 0
        return before.most - len(before.examples) if before.last < run.first else before.most

    def _severity(self, rule: str, said: Severity | None, near_drops: bool) -> Severity:
        if rule in self._severities:
            return self._severities[rule]
        return "note" if near_drops else said or self._pages[rule].severity

    def _apart(self, key: FindingKey) -> KeyRuns | None:
        """Return the runs of a key that are kept apart: those beyond `MOST_GROUPS` share one."""
        return self.kept.get(key) or (self._kept_of(key) if len(self.kept) < MOST_GROUPS else None)

    def _kept_of(self, key: FindingKey) -> KeyRuns:
        """Return the runs of a key, which has its place from now on."""
        kept = self.kept.get(key)
        if kept is None:
            kept = self.kept[key] = KeyRuns(key, self._rules[key.rule], self._last_runs)
            self._numbered.append(kept)
            self._key_names.add(key.key)
            self.spots.setdefault(kept.spot, []).append(key)
            self.keys.setdefault(kept.spot.where, []).append(key)
        return kept

    def _put(self, kept: KeyRuns, run: OccurrenceRun) -> None:
        runs, rule, key = kept.runs, kept.rule, kept.key
        before = len(runs)
        if runs and rule.crowded:
            absorb(runs, run)
        else:
            merge(runs, run, rule.close)
        if rule.page.explained and len(runs) > MOST_PIECES:
            others = (one for name in rule.page.explained for one in self.keys.get(RuleAt(name, key.bus, key.node), ()))
            runs[:] = joined(runs, [run for one in others for run in self.kept[one].runs])
        rule.count += len(runs) - before
        rule.crowded = rule.plain and rule.count >= MOST_APART
        self._total += len(runs) - before
        self._mark(kept)

    def _mark(self, kept: KeyRuns) -> None:
        """Note that something was added."""
        self._added += 1
        if not kept.changed:
            kept.changed = True
            self._changed.append(kept)


def _shared(rule: str, severity: Severity, dialects: tuple[tuple[str, Severity | None], ...]) -> FindingKey:
    """Return the key of what comes when no more keys are kept apart."""
    return FindingKey(rule, severity, -1, -1, "", FURTHER, dialects)
