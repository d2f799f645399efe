"""The runs that a report tells of: read as their nodes turned out to mean it, each with its cause, by place."""

from __future__ import annotations

from bisect import insort
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
    _Pair = tuple[FindingKey, OccurrenceRun]

_FEW = 16  # times as many are known as are new: then each of these is put where it belongs
_TOGETHER = 2 * SECOND  # what an event explains of a node may begin so long before its last report


class _ToldRun:
    """The run that is told from a place, the same pair as long as it says the same; and that with one example."""

    __slots__ = ("place", "short", "told")

    def __init__(self, told: _Pair) -> None:
        self.place = told[1].first, told[0]
        self.told: _Pair | None = None  # also once nothing is told from here any more
        self.tell(told)

    def tell(self, told: _Pair) -> None:
        """Take what is told now; what says the same as before is left as it was."""
        before, run = None if self.told is None else self.told[1], told[1]
        if (
            before is None
            or before.last != run.last
            or before.count != run.count
            or before.text != run.text
            or before.examples != run.examples
        ):
            self.told, self.short = told, _short(told)


def _short(told: _Pair) -> _Pair:
    """Return a run with one example."""
    key, run = told
    return told if len(run.examples) < 2 else (key, run.copy(1))


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
        self._every: list[_ToldRun] = []  # of all spots, by place, as of the last time
        self._new: list[_ToldRun] = []
        self._gone = False  # some of them are told no more
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
        work = _Work(findings, self._pages, self._severities, choices)
        if over:
            runs = chain.from_iterable(work.told(spot, end, over=True) for spot in findings.spots)
            told = sorted(runs, key=lambda one: (one[1].first, one[0]))
            return [*told[:RICH], *map(_short, told[RICH:])]
        for spot in self._due(findings, choices):
            self._tell(spot, work.told(spot, end, over=False))
        every = self._by_place()
        return [*map(_TOLD, every[:RICH]), *map(_SHORT, every[RICH:])]

    def _tell(self, spot: Spot, runs: Iterable[_Pair]) -> None:
        """Take what is told of a spot now."""
        before = {one.place: one for one in self._spots.get(spot, ())}
        now: list[_ToldRun] = []
        for told in runs:
            key, run = told
            one = before.pop((run.first, key), None)
            if one is None:
                one = _ToldRun(told)
                self._new.append(one)
            else:
                one.tell(told)
            now.append(one)
            if run.episode is not None:
                self._lasting.add(spot)
        for one in before.values():
            one.told = None
            self._gone = True
        self._spots[spot] = now

    def _by_place(self) -> list[_ToldRun]:
        """Return all that is told: in order but for what is new."""
        if self._gone:
            self._every = [one for one in self._every if one.told is not None]
        if len(self._new) > len(self._every) // _FEW:
            self._every = sorted(self._every + self._new, key=_PLACE)
        else:
            for one in self._new:
                insort(self._every, one, key=_PLACE)
        self._new, self._gone = [], False
        return self._every

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
            named = key
            if key.dialects:
                choices = self._choices.get((key.bus, key.node), ())
                for choice, instead in key.dialects:
                    if choice in choices:
                        severity = instead if instead is None else self._severities.get(key.rule, instead)
                if severity is not None:
                    named = key._replace(severity=severity, dialects=())
            if severity is not None:
                known = found.setdefault(named, [])
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
