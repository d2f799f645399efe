"""One capture under all rules: what they found, the facts of the capture, and what it exercised."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from analyzer.facts.node_names import NodeNames
from analyzer.facts.summary import Summary
from analyzer.rules.clock import Clock
from analyzer.rules.columns import Frames
from analyzer.rules.course import Course
from analyzer.rules.coverage import Tracker
from analyzer.rules.judge import Judge
from analyzer.rules.load import bit_times

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from analyzer.engine import Batch, Engine
    from analyzer.facts.summary import Facts, Stored
    from analyzer.rules.coverage import Seen
    from analyzer.rules.judge import Outcome
    from analyzer.rules.settings import Settings
    from dissectors import Registry
    from dissectors.conformance import Words


@dataclass(frozen=True, slots=True)
class Checked:
    """A capture after the last batch. `names` are what nodes call themselves, by (bus, node).

    `coarse` are times too far apart to judge rules by.
    """

    facts: Facts
    outcome: Outcome
    seen: Seen
    course: Course
    names: Mapping[tuple[int, int], str] = field(default_factory=dict)
    coarse: bool = False


class Measured(NamedTuple):
    """A batch, and the `bit_times` of its frames."""

    batch: Batch
    bits: Words


class Check:
    """Adds up batches of one capture, first `measured` and then fed; memory is bounded."""

    def __init__(self, registry: Registry, settings: Settings) -> None:
        self.judge = Judge(registry, settings)
        self._summary = Summary(registry, read=self.judge.dialects)
        self._seen = Tracker(registry)
        self._course = Course()
        self._clock = Clock()
        self._names = NodeNames()

    def measured(self, batches: Iterable[Batch]) -> Iterator[Measured]:
        """What no rule is needed for: another thread may do this while `feed` judges what came before."""
        for batch in batches:
            self._summary.add(batch)
            self._clock.look(batch)
            yield Measured(batch, bit_times(Frames(batch.frames)))

    def feed(self, measured: Measured) -> None:
        """The next batch."""
        batch, bits = measured
        view = self.judge.feed(batch, bits)
        self._seen.look(view)
        self._course.look(view)
        self._names.look(batch.messages)

    def finish(self, stored: Iterable[Stored], engine: Engine) -> Checked:
        """Everything, after the last batch of the captures `stored`."""
        outcome, facts = self.judge.finish(), self._summary.finish(stored, engine)
        return Checked(facts, outcome, self._seen.seen(), self._course, self._names.all, self._clock.coarse)
