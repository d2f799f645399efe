"""Runs every rule over a capture, batch by batch: occurrences in, findings out."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from analyzer.rules import watchers
from analyzer.rules.catalogue import load
from analyzer.rules.drops import Drops
from analyzer.rules.exercise import Exercises
from analyzer.rules.findings import Findings
from analyzer.rules.settings import Settings
from analyzer.rules.view import Past
from dissectors.conformance import SECOND

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from analyzer.engine import Batch
    from analyzer.facts.dialects import Dialects, Statement
    from analyzer.rules.catalogue import Page
    from analyzer.rules.findings import Key, Run
    from analyzer.rules.view import View
    from dissectors import Registry
    from dissectors.conformance import Found, Occurrence, Words


@dataclass(frozen=True, slots=True)
class Outcome:
    """What the rules found: runs by what keeps them apart, by place; what the capture exercised, in words.

    `labels` name units by (bus, node), `readings` say how each node's doubtful fields were read, `facts` are numbers of
    the capture as `dissectors.conformance.Measures` names them.
    """

    runs: tuple[tuple[Key, Run], ...]
    words: frozenset[str]
    labels: Mapping[tuple[int, int], str]
    readings: tuple[Statement, ...]
    facts: Mapping[str, float] = field(default_factory=dict)


class Judge:
    """One capture's judge.

    Args:
        registry: the types that the capture is decoded with.
        settings: what is looked for, and with which numbers.
    """

    def __init__(self, registry: Registry, settings: Settings | None = None) -> None:
        settings = settings or Settings()
        self.pages: Mapping[str, Page] = load(registry)
        self.enabled = settings.enabled(self.pages)
        self.numbers = settings.all_numbers(self.pages)
        self._past = Past(registry, self.numbers, settings.bit_rate, settings.dialects)
        self._findings = Findings(self.enabled, settings.severities)
        self._drops = Drops(round(self.numbers["CAP-004"]["around_s"] * SECOND))
        brought = watchers.brought(registry)
        self._exercises = Exercises(registry, [kind for one in brought for kind in one.exercises])
        self._name_units = [one.labels for one in brought if one.labels is not None]
        self._labels: dict[tuple[int, int], str] = {}
        made = watchers.all_of(registry, self.enabled, brought)
        self._watchers = [one for one in made if not self.enabled.keys().isdisjoint(one.rules)]

    @property
    def dialects(self) -> Dialects:
        """How nodes' doubtful fields are read, from the batches so far."""
        return self._past.dialects

    def feed(self, batch: Batch, bits: Words | None = None) -> View:
        """The next batch; gives it as the rules saw it. `bits` are the `bit_times` of its frames, if they are known."""
        view = self._past.add(batch, bits)
        self._exercises.look(view)
        for name_units in self._name_units:
            self._labels |= {(bus, node): label for bus, node, label in name_units(view)}
        self._drops.add(view)
        with np.errstate(all="ignore"):  # a bus may carry any bits, those of numbers that are none among them
            for watcher in self._watchers:
                self._take(watcher.look(view), view)
            self._release(view, view.end)
        return view

    @property
    def changes(self) -> int:
        """Another number whenever `so_far` may have more to tell."""
        return self._findings.changes

    def so_far(self) -> Outcome:
        """What is known before the end: runs as they stand now, without what only the end will tell."""
        readings = tuple(self._past.dialects.statements())
        return Outcome(tuple(self._findings.results(readings)), frozenset(), dict(self._labels), readings)

    def finish(self) -> Outcome:
        """Everything, after the last batch."""
        view = self._past.finish()
        with np.errstate(all="ignore"):
            for watcher in self._watchers:
                self._take(watcher.settle(view), view)
            self._release(view, None)
        readings = tuple(self._past.dialects.statements())
        return Outcome(
            runs=tuple(self._findings.results(readings)),
            words=self._exercises.words(),
            labels=self._labels,
            readings=readings,
            facts=self._exercises.facts(),
        )

    def _take(self, found: Iterable[Found | Occurrence], view: View) -> None:
        for one in found:
            if one.rule not in self.enabled:
                continue
            if one.drops:
                self._drops.hold(one)
            else:
                self._findings.add(one, view)

    def _release(self, view: View, end: int | None) -> None:
        for one, near in self._drops.ready(end):
            self._findings.add(one, view, near_drops=near)
