"""The runs that a report tells of: read as their nodes turned out to mean it, each with its cause, by place."""

from __future__ import annotations

from itertools import chain
from operator import attrgetter
from typing import TYPE_CHECKING, Any, Self

from analyzer.decode.readings import FORCED
from analyzer.rules.found.keys import RuleAt
from analyzer.rules.found.runs import RICH, closeness, meets, merge, without_pause
from dissectors.kit import NO_TIME, SECOND

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from analyzer.decode.readings import Statement
    from analyzer.rules.catalogue import Page
    from analyzer.rules.found.findings import Findings
    from analyzer.rules.found.keys import FindingKey, Spot
    from analyzer.rules.found.runs import OccurrenceRun
    from dissectors.kit import Severity, Values

    _Choices = dict[tuple[int, int], set[str]]

_TOGETHER = 2 * SECOND  # what an event explains of a node may begin so long before its last report


class _ToldRun:
    """A run to tell of, and the same with one example, once that is asked for."""

    __slots__ = ("_short", "place", "told")

    def __init__(self, key: FindingKey, run: OccurrenceRun) -> None:
        self.told, self.place = (key, run), (run.first, key)
        self._short: tuple[FindingKey, OccurrenceRun] | None = None

    def or_same(self, before: _ToldRun | None) -> _ToldRun:
        """Return what was told before from the same place if that says the same."""
        if before is None:
            return self
        (_, one), (_, run) = self.told, before.told
        same = one.last == run.last and one.count == run.count and one.text == run.text
        return before if same and one.examples == run.examples else self

    @property
    def short(self) -> tuple[FindingKey, OccurrenceRun]:
        """The run with one example."""
        if self._short is None:
            key, run = self.told
            if len(run.examples) > 1:
                run = run.copy()
                del run.examples[1:]
            self._short = key, run
        return self._short


_PLACE, _TOLD, _SHORT = attrgetter("place"), attrgetter("told"), attrgetter("short")


class Results:
    """Works them out, again and again while more is added: only where something has changed since the last time.

    What is told of a spot depends on nothing but its own runs, how its node is read, and the runs of those rules at the
    same node that may be causes of it. What has not changed is the same pair again.

    Args:
        pages: the pages of the rules that are looked for.
        severities: severities that stand instead of those of pages and occurrences.
    """

    def __init__(self, pages: Mapping[str, Page], severities: Mapping[str, Severity]) -> None:
        self._pages, self._severities = pages, severities
        self._spots: dict[Spot, list[_ToldRun]] = {}
        self._lasting: set[Spot] = set()  # those whose text goes on with the time
        self._choices: _Choices = {}
        self._explains: dict[str, list[str]] = {}
        for rule, page in pages.items():
            for cause in page.explained:
                self._explains.setdefault(cause, []).append(rule)

    def __deepcopy__(self, _: Any) -> Self:
        """Return one that works everything out anew."""
        return type(self)(self._pages, self._severities)

    def of(
        self, findings: Findings, readings: Iterable[Statement], end: int = NO_TIME, *, over: bool = True
    ) -> list[tuple[FindingKey, OccurrenceRun]]:
        """Return every run by place; what is no breach in the reading that its node turned out to use is left out.

        Args:
            findings: always the same ones.
            readings: how the doubtful fields of nodes are read.
            end: the time of the last frame.
            over: no more will be added.
        """
        choices: _Choices = {}
        for one in readings:
            choices.setdefault((one.bus, one.node), set()).add(one.choice.removesuffix(FORCED))
        told = {} if over else self._spots
        due: Iterable[Spot] = findings.spots if over else self._due(findings, choices)
        work = _Work(findings, self._pages, self._severities, choices)
        for spot in due:
            before = {one.place: one for one in told.get(spot, ())}
            found = [_ToldRun(*one) for one in work.told(spot, end, over=over)]
            told[spot] = [one.or_same(before.get(one.place)) for one in found]
            if not over and any(run.episode is not None for _, run in map(_TOLD, found)):
                self._lasting.add(spot)
        every = sorted(chain.from_iterable(told.values()), key=_PLACE)
        return [*map(_TOLD, every[:RICH]), *map(_SHORT, every[RICH:])]

    def _due(self, findings: Findings, choices: _Choices) -> set[Spot]:
        """Return the spots where something may be told that was not the last time."""
        changed = findings.take_changed() if self._spots else set(findings.spots)
        due = changed | self._lasting
        due |= {
            key.spot
            for rule, bus, node in {spot.where for spot in changed}
            for explained in self._explains.get(rule, ())
            for key in findings.keys.get(RuleAt(explained, bus, node), ())
        }
        if choices != self._choices:
            nodes = {node for node in choices | self._choices if choices.get(node) != self._choices.get(node)}
            due |= {spot for spot in findings.spots if (spot.bus, spot.node) in nodes}
            self._choices = choices
        return due


class _Work:
    """One time of working out; causes that are asked for several times are found once."""

    def __init__(
        self, findings: Findings, pages: Mapping[str, Page], severities: Mapping[str, Severity], choices: _Choices
    ) -> None:
        self._findings, self._pages, self._severities, self._choices = findings, pages, severities, choices
        self._causes: dict[RuleAt, list[OccurrenceRun]] = {}

    def told(self, spot: Spot, end: int, *, over: bool) -> Iterator[tuple[FindingKey, OccurrenceRun]]:
        """Yield the runs of a spot as they are told; those of episodes that came and went together are one."""
        page = self._pages[spot.rule]
        together: dict[tuple[object, ...], list[tuple[FindingKey, OccurrenceRun, Values]]] = {}
        for key, runs in self._caused(spot, page).items():
            for run in runs:
                if run.episode is None:
                    yield key, run
                    continue
                values = run.episode.values(run.count, (run.first[0], run.last[0]), end, over=over)
                same = str({name: value for name, value in values.items() if name not in page.key})
                course = key._replace(key=""), run.first, run.last, run.count, run.episode.times, same
                together.setdefault(course, []).append((key, run, values))
        for alike in together.values():
            yield _as_one(alike, page)

    def _caused(self, spot: Spot, page: Page) -> dict[FindingKey, list[OccurrenceRun]]:
        """Make notes of what another finding of the same node at that time is the cause of, and of nothing else.

        What an event is the cause of is left out.
        """
        settled = self._settled(self._findings.spots.get(spot, ()))
        if not page.explained:
            return settled
        because: dict[str, list[OccurrenceRun]] = {}
        events: list[OccurrenceRun] = []
        for rule in page.explained:
            if rule in self._pages:
                causes = self._causes_of(RuleAt(rule, spot.bus, spot.node))
                if self._pages[rule].event:
                    events += causes
                else:
                    because[rule] = causes
        found: dict[FindingKey, list[OccurrenceRun]] = {}
        for key, runs in settled.items():
            stays = key.severity == "note" or key.rule in self._severities
            for run in runs:
                if any(run.first[0] >= event.first[0] - _TOGETHER for event in events):
                    continue
                near = (rule for rule, others in because.items() if any(meets(other, run) for other in others))
                cause = None if stays else next(near, None)
                if cause is not None:
                    named = f"{self._pages[cause].title} ({cause})"
                    run.examples = [one._replace(cause=one.cause or named) for one in run.examples]
                merge(found.setdefault(key if cause is None else key._replace(severity="note"), []), run, without_pause)
        return found

    def _causes_of(self, where: RuleAt) -> list[OccurrenceRun]:
        """Return what a rule found of a node that may be the cause of something else."""
        if where not in self._causes:
            notes = self._pages[where.rule].severity == "note"
            settled = self._settled(self._findings.keys.get(where, ())).items()
            self._causes[where] = [run for key, runs in settled if notes or key.severity != "note" for run in runs]
        return self._causes[where]

    def _settled(self, keys: Iterable[FindingKey]) -> dict[FindingKey, list[OccurrenceRun]]:
        """Return copies of the runs of some keys as their node is read; without those that are no breach then."""
        found: dict[FindingKey, list[OccurrenceRun]] = {}
        for key in keys:
            severity: Severity | None = key.severity
            if key.dialects:
                choices = self._choices.get((key.bus, key.node), ())
                for choice, instead in key.dialects:
                    if choice in choices:
                        severity = instead if instead is None else self._severities.get(key.rule, instead)
            if severity is not None:
                known = found.setdefault(key._replace(severity=severity, dialects=()), [])
                close = closeness(self._pages[key.rule])
                for run in self._findings.kept[key].runs:
                    merge(known, run.copy(), close)
        return found


def _as_one(alike: Sequence[tuple[FindingKey, OccurrenceRun, Values]], page: Page) -> tuple[FindingKey, OccurrenceRun]:
    """Return the run of episodes with its text; that of several names them all."""
    key, run, values = alike[0]
    if len(alike) > 1:
        values = {**values, **{name: ", ".join(str(one[name]) for _, _, one in alike) for name in page.key}}
        key = key._replace(key=page.key_of(values))
    run.text = page.say(values) if run.count == 1 else page.say_episode(values)
    return key, run
