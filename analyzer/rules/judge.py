"""Runs every rule over a capture, batch by batch: occurrences in, findings out."""

from __future__ import annotations

from copy import deepcopy
from typing import TYPE_CHECKING

import numpy as np

from analyzer.rules import discovery
from analyzer.rules.catalogue import load
from analyzer.rules.drops import Drops
from analyzer.rules.exercised.exercise import Exercises
from analyzer.rules.found.findings import Findings
from analyzer.rules.found.results import Results
from analyzer.rules.settings import Settings
from analyzer.rules.vehicle.channels import ChannelLabels
from analyzer.rules.view import Past
from dissectors.kit import SECOND
from dissectors.records import dataclass, field

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from analyzer.decode.engine import Batch
    from analyzer.decode.places import Places
    from analyzer.decode.readings import Statement
    from analyzer.rules.catalogue import Page
    from analyzer.rules.found.keys import FindingKey
    from analyzer.rules.found.runs import OccurrenceRun
    from analyzer.rules.named_frames import TakesOccurrences
    from analyzer.rules.vehicle.own import OwnRules
    from analyzer.rules.vehicle.own_judge import OwnJudge
    from dissectors import Registry
    from dissectors.kit import Array, Occurrence, Occurrences, View


@dataclass(frozen=True, slots=True)
class Outcome:
    """All that the rules found: runs by what keeps them apart, by place; what the capture exercised, in words.

    `labels` name units by (bus, node), `readings` say how each node's doubtful fields were read, `facts` are numbers of
    the capture as `dissectors.conformance.Measures` names them.
    """

    runs: tuple[tuple[FindingKey, OccurrenceRun], ...]
    words: frozenset[str]
    labels: Mapping[tuple[int, int], str]
    readings: tuple[Statement, ...]
    facts: Mapping[str, float] = field(default_factory=dict)


class Judge:
    """One capture's judge.

    Args:
        registry: the types that the capture is decoded with.
        settings: what is looked for, and with which numbers.
        named: is told which frames are named.
    """

    def __init__(
        self, registry: Registry, settings: Settings | None = None, named: TakesOccurrences | None = None
    ) -> None:
        self._named = named
        settings = settings or Settings()
        own = settings.own
        self.pages: Mapping[str, Page] = load(registry) if own is None else {**load(registry), **own.pages}
        self.enabled = settings.enabled(self.pages)
        self.numbers = settings.all_numbers(self.pages)
        self._past = Past(registry, self.numbers, settings.bit_rate)
        self._past.cut_in = settings.cut_in
        self._findings = Findings(self.enabled, settings.severities)
        self._results = Results(self.enabled, settings.severities)
        around, beside = (round(self.numbers[rule]["around_s"] * SECOND) for rule in ("CAP-004", "CAP-006"))
        self._drops = Drops(around, beside, {rule for rule, page in self.pages.items() if page.key})
        conformances = discovery.conformances_of(registry)
        self._exercises = Exercises(registry, [kind for one in conformances for kind in one.exercises])
        vendors = [one.labels for one in conformances if one.labels is not None]
        self._name_units = [ChannelLabels(registry).labels, *vendors]
        self._labels: dict[tuple[int, int], str] = {}
        made = discovery.new_rules(registry, self.enabled, conformances)
        self._rules = [one for one in made if not self.enabled.keys().isdisjoint(one.rules)]
        self._own = None if own is None else _own_judge(own, self.enabled, registry)
        self._places: Places | None = None

    def feed(self, batch: Batch, bits: Array | None = None) -> View:
        """Judge the next batch.

        Return it as the rules saw it. `bits` are the `bit_times` of its frames, if they are known.
        """
        view, self._places = self._past.feed(batch, bits), batch.places
        self._exercises.feed(view)
        for name_units in self._name_units:
            self._labels |= {(bus, node): label for bus, node, label in name_units(view)}
        self._drops.feed(view)
        with np.errstate(all="ignore"):  # a bus may carry any bits, those of numbers that are none among them
            self._release(view, view.end)  # first of all: what waits keeps the batch before this one
            for rule in self._rules:
                self._take(rule.feed(view), view)
            if self._own is not None:
                self._take(self._own.feed(view), view)
            self._release(view, view.end)
        return view

    @property
    def changes(self) -> int:
        """Another number whenever `so_far` may have more to tell."""
        return self._findings.changes

    def so_far(self) -> Outcome:
        """Return what is known before the end: runs as they stand now, without what only the end will tell.

        A run that is as it was the last time is the same pair.
        """
        readings = self._past.dialects.statements
        runs = self._results.of(self._findings, readings, self._past.end, over=False)
        return Outcome(self._placed(runs), frozenset(), dict(self._labels), readings)

    def as_ended(self) -> Outcome:
        """Return what `finish` would if there were no more batches; there may be.

        Raises whatever the state of a rule raises that cannot be copied.
        """
        return deepcopy(self).finish()

    def finish(self) -> Outcome:
        """Return everything, after the last batch."""
        view = self._past.finish()
        self._drops.add(view.joint_losses)
        with np.errstate(all="ignore"):
            for rule in self._rules:
                self._take(rule.finish(view), view)
            if self._own is not None:
                self._take(self._own.finish(view), view)
            self._release(view, None)
        readings = self._past.dialects.statements
        return Outcome(
            runs=self._placed(self._results.of(self._findings, readings, self._past.end)),
            words=self._exercises.words() | (frozenset() if self._own is None else self._own.words),
            labels=self._labels,
            readings=readings,
            facts=self._exercises.facts(),
        )

    def _placed(self, runs: Sequence[tuple[FindingKey, OccurrenceRun]]) -> tuple[tuple[FindingKey, OccurrenceRun], ...]:
        """Return the runs with frames numbered as in the capture that they were picked from."""
        if self._places is None:
            return tuple(runs)
        return tuple((key, run.placed(self._places)) for key, run in runs)

    def _take(self, found: Iterable[Occurrences | Occurrence], view: View) -> None:
        for one in found:
            if one.rule not in self.enabled:
                continue
            if one.drops:
                self._drops.hold(one)
            else:
                self._add(one, view)

    def _add(self, found: Occurrences | Occurrence, view: View, near_drops: Array | None = None) -> None:
        self._findings.feed(found, view, near_drops=near_drops)
        if self._named is not None:
            self._named.feed(found)

    def _release(self, view: View, end: int | None) -> None:
        for one, near in self._drops.ready(end):
            self._add(one, view, near)


def _own_judge(own: OwnRules, enabled: Iterable[str], registry: Registry) -> OwnJudge:
    from analyzer.rules.vehicle.own_judge import OwnJudge  # noqa: PLC0415 - filters are for those who write some

    return OwnJudge(own, enabled, registry)
