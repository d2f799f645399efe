"""Occurrences to findings: what one node does wrong again and again is one line, with its first and last time.

The result does not depend on the order in which occurrences come in, as long as no bound is reached.
"""

from __future__ import annotations

from bisect import bisect_left
from typing import TYPE_CHECKING, Any, NamedTuple

from analyzer.decode.readings import FORCED
from analyzer.rules.episodes import episode_of
from analyzer.rules.groups import all_one, by_pause, by_piece, by_place, pieces_by_key, split
from analyzer.rules.runs import (
    MOST_EXAMPLES,
    OccurrenceRun,
    Shown,
    absorb,
    is_full,
    joined,
    meets,
    merge,
    same_piece,
    without_pause,
)
from dissectors.kit import NO_TIME, SECOND, Occurrence, Occurrences
from dissectors.kit.occurrence import TURNED

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from analyzer.decode.readings import Statement
    from analyzer.rules.catalogue import Page
    from dissectors.kit import Severity, Values, View

MOST_PIECES = 24  # of a run that may be explained in parts; of more, those long past that are alike are put together
MOST_GROUPS = 4096  # of rule, node, type and key; what comes later is one finding a rule
RICH = 500  # runs with all their examples, the first ones in the capture; the others have one
KEPT = 4 * RICH  # runs whose examples are kept until it is known which ones are the first
MOST_APART = 1024  # runs of one rule; from then on a pause ends none where nothing is explained by a part
FURTHER = "further"
_TOGETHER = 2 * SECOND  # what an event explains of a node may begin so long before its last report


class FindingKey(NamedTuple):
    """The key that keeps findings apart. `node` is -1 and `type` empty for none."""

    rule: str
    severity: Severity
    bus: int
    node: int
    type: str
    key: str
    dialects: tuple[tuple[str, Severity | None], ...]


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
        self._runs: dict[FindingKey, list[OccurrenceRun]] = {}
        self._keys: dict[tuple[str, int, int], list[FindingKey]] = {}  # those of a rule, bus and node
        self._spots: dict[str, set[tuple[int, int, str]]] = {}  # of rules: bus, node and type of keys
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

    def results(
        self, readings: Iterable[Statement], end: int = NO_TIME, *, over: bool = True
    ) -> list[tuple[FindingKey, OccurrenceRun]]:
        """Return every run by place; what is no breach in the reading that its node turned out to use is left out.

        It may be asked for again after more has been added.

        Args:
            readings: how the doubtful fields of nodes are read.
            end: the time of the last frame.
            over: no more will be added.
        """
        choices: dict[tuple[int, int], set[str]] = {}
        for one in readings:
            choices.setdefault((one.bus, one.node), set()).add(one.choice.removesuffix(FORCED))
        settled: dict[FindingKey, list[OccurrenceRun]] = {}
        for key, runs in self._runs.items():
            severity: Severity | None = key.severity
            for choice, instead in key.dialects:
                if choice in choices.get((key.bus, key.node), ()):
                    severity = instead if instead is None else self._severities.get(key.rule, instead)
            if severity is not None:
                known = settled.setdefault(key._replace(severity=severity, dialects=()), [])
                for run in runs:
                    merge(known, run.copy(), self._close(key))
        found = [(key, run) for key, runs in self._caused(settled).items() for run in runs]
        found = list(self._told(found, end, over=over))
        found.sort(key=lambda one: (one[1].first, one[0]))
        for _, run in found[RICH:]:
            del run.examples[1:]
        return found

    def _caused(self, settled: Mapping[FindingKey, Sequence[OccurrenceRun]]) -> dict[FindingKey, list[OccurrenceRun]]:
        """Make notes of what another finding of the same node at that time is the cause of, and of nothing else.

        What an event is the cause of is left out.
        """
        causes: dict[tuple[str, int, int], list[OccurrenceRun]] = {}
        for key, runs in settled.items():
            if key.severity != "note" or self._pages[key.rule].severity == "note":
                causes.setdefault((key.rule, key.bus, key.node), []).extend(runs)
        found: dict[FindingKey, list[OccurrenceRun]] = {}
        for key, runs in settled.items():
            stays = key.severity == "note" or key.rule in self._severities
            explained = () if stays else self._pages[key.rule].explained
            told = [rule for rule in self._pages[key.rule].explained if rule in self._pages and self._pages[rule].event]
            place = key.bus, key.node
            because = [(rule, causes.get((rule, *place), ())) for rule in explained if rule not in told]
            events = [event for rule in told for event in causes.get((rule, *place), ())]
            for run in runs:
                if any(run.first[0] >= event.first[0] - _TOGETHER for event in events):
                    continue
                rules = [rule for rule, others in because if any(meets(other, run) for other in others)]
                if rules:
                    cause = f"{self._pages[rules[0]].title} ({rules[0]})"
                    run.examples = [one._replace(cause=one.cause or cause) for one in run.examples]
                merge(found.setdefault(key._replace(severity="note") if rules else key, []), run, without_pause)
        return found

    def _told(
        self, found: Iterable[tuple[FindingKey, OccurrenceRun]], end: int, *, over: bool
    ) -> Iterator[tuple[FindingKey, OccurrenceRun]]:
        """Yield runs, episodes with their text; those of one node that came and went together are one."""
        together: dict[tuple[object, ...], list[tuple[FindingKey, OccurrenceRun, Values]]] = {}
        for key, run in found:
            if run.episode is None:
                yield key, run
                continue
            values = run.episode.values(run.count, (run.first[0], run.last[0]), end, over=over)
            of = self._pages[key.rule].key
            same = str({name: value for name, value in values.items() if name not in of})
            course = key._replace(key=""), run.first, run.last, run.count, run.episode.times, same
            together.setdefault(course, []).append((key, run, values))
        for alike in together.values():
            key, run, values = alike[0]
            page = self._pages[key.rule]
            joint = {name: ", ".join(str(one[name]) for _, _, one in alike) for name in page.key}
            values = {**values, **joint} if len(alike) > 1 else values
            run.text = page.say(values) if run.count == 1 else page.say_episode(values)
            yield key._replace(key=page.key_of(values) if len(alike) > 1 else key.key), run

    def _add_one(self, one: Occurrence, view: View, near_drops: bool) -> None:
        page = self._pages[one.rule]
        key = FindingKey(
            one.rule, self._severity(one.rule, one.severity, near_drops), one.bus, -1 if one.node is None else one.node,
            one.type, page.key_of(one.values), tuple(one.dialects.items()),
        )  # fmt: skip
        key = key if self._has_room(key) else key._replace(bus=-1, node=-1, type="", key=FURTHER)
        place = (one.t, one.frames[0] if one.frames else -1)
        if self._is_inside(key, place):
            return
        run = OccurrenceRun(place, place, 1)
        if self._room(key, run):
            cause = str(one.values.get("cause", ""))
            lines = one.lines or view.lines(one.frames)
            run.examples = [Shown(*place, page.say(one.values), cause, tuple(one.frames), lines)]
        self._put(key, run)

    def _add_many(self, found: Occurrences, view: View, near_drops: Sequence[bool] | None) -> None:
        page, spots = self._pages[found.rule], self._spots.setdefault(found.rule, set())
        further: dict[tuple[bool, bool], list[Any]] = {}
        full = len(self._runs) >= MOST_GROUPS
        told, shared = _Told(found, page, view), dict[tuple[bool, bool], FindingKey]()
        apart = by_piece if page.explained else all_one if self._is_crowded(found.rule) else by_pause
        placed: list[tuple[FindingKey, Any]] = []
        for pieces, noted, doubtful, bus, node, number in pieces_by_key(found, near_drops, apart):
            if (noted, doubtful) not in shared:
                shared[noted, doubtful] = self._shared_key(found, noted, doubtful)
            last, type_ = shared[noted, doubtful], view.type_name(number)
            if not full or (bus, node, type_) in spots:
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
            self._put(key, self._run(told, piece, key))

    def _shared_key(self, found: Occurrences, noted: bool, doubtful: bool) -> FindingKey:
        """Return the key that what comes later shares; `doubtful`: its values may be those of another reading."""
        severity = self._severity(found.rule, found.severity, noted)
        dialects = (*found.dialects.items(), *(TURNED.items() if doubtful else ()))
        return FindingKey(found.rule, severity, -1, -1, "", FURTHER, dialects)

    def _run(self, told: _Told, rows: Any, key: FindingKey) -> OccurrenceRun:
        first, found = rows.item(0), told.found
        place = told.place(first)
        end = place if len(rows) == 1 else told.place(rows.item(-1))
        run = OccurrenceRun(place, end, len(rows), episode=episode_of(found, rows))
        room = self._room(key, run)
        if room:
            if run.episode is not None:
                run.episode.onset = found.values(first)
            all_ = self._total < KEPT or key.key == FURTHER or found.lines is not None
            run.examples = [told.example(row) for row in rows[: room if all_ else 1].tolist()]
        return run

    def _is_inside(self, key: FindingKey, place: tuple[int, int]) -> bool:
        """Return whether an occurrence lies inside a run that has all its examples, and count it there then."""
        run = self._before(key, place)
        if run is None or place > run.last or run.episode is not None or not is_full(run, place):
            return False
        run.count += 1
        self.changes += 1
        return True

    def _before(self, key: FindingKey, place: tuple[int, int]) -> OccurrenceRun | None:
        """Return the last run of a key that began before a place."""
        runs = self._runs.get(key)
        if not runs:
            return None
        at = len(runs) if runs[-1].first < place else bisect_left(runs, place, key=lambda one: one.first)
        return runs[at - 1] if at else None

    def _room(self, key: FindingKey, run: OccurrenceRun) -> int:
        """Return how many examples of a run may be shown: it may go on with one that has some, or all it may have."""
        before = self._before(key, run.first)
        if before is not None and self._is_crowded(key.rule):
            return 0
        if before is None or not self._close(key)(before, run):
            return MOST_EXAMPLES
        if is_full(before, run.first):
            return 0
        return MOST_EXAMPLES - len(before.examples) if before.last < run.first else MOST_EXAMPLES

    def _close(self, key: FindingKey) -> Callable[[OccurrenceRun, OccurrenceRun], bool]:
        """Return what makes one run of two: nothing but a pause, unless a part of them may be explained."""
        return same_piece if self._pages[key.rule].explained else without_pause

    def _is_crowded(self, rule: str) -> bool:
        """Return whether an occurrence joins the run of its key before it, whatever the pause between."""
        return rule in self._plain and self._counts.get(rule, 0) >= MOST_APART

    def _severity(self, rule: str, said: Severity | None, near_drops: bool) -> Severity:
        if rule in self._severities:
            return self._severities[rule]
        return "note" if near_drops else said or self._pages[rule].severity

    def _has_room(self, key: FindingKey) -> bool:
        """Return whether occurrences of a key are kept apart: those beyond `MOST_GROUPS` share one."""
        return key in self._runs or len(self._runs) < MOST_GROUPS

    def _runs_of(self, key: FindingKey) -> list[OccurrenceRun]:
        """Return the runs of a key, which has its place from now on."""
        runs = self._runs.get(key)
        if runs is None:
            runs = self._runs[key] = []
            self._keys.setdefault((key.rule, key.bus, key.node), []).append(key)
            self._spots.setdefault(key.rule, set()).add((key.bus, key.node, key.type))
        return runs

    def _put(self, key: FindingKey, run: OccurrenceRun) -> None:
        self.changes += 1
        runs = self._runs_of(key)
        before = len(runs)
        if runs and self._is_crowded(key.rule):
            absorb(runs, run)
        else:
            merge(runs, run, self._close(key))
        explained = self._pages[key.rule].explained
        if explained and len(runs) > MOST_PIECES:
            others = (one for rule in explained for one in self._keys.get((rule, key.bus, key.node), ()))
            runs[:] = joined(runs, [run for one in others for run in self._runs[one]])
        self._counts[key.rule] = self._counts.get(key.rule, 0) + len(runs) - before
        self._total += len(runs) - before
