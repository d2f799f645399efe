"""One capture under all rules: what they found, the facts of the capture, and what it exercised."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from analyzer.facts.clock import TimeResolution
from analyzer.facts.summary import Summary
from analyzer.rules.course import Course
from analyzer.rules.exercised.coverage import Tracker
from analyzer.rules.judge import Judge
from analyzer.rules.load import bit_times
from dissectors.kit import FrameTable

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from analyzer.decode.engine import Batch, Engine
    from analyzer.facts.summary import Facts, StoredCapture
    from analyzer.facts.traffic import ForeignIds
    from analyzer.rules.exercised.coverage import Seen
    from analyzer.rules.judge import Outcome
    from analyzer.rules.named_frames import TakesOccurrences
    from analyzer.rules.settings import Settings
    from dissectors import Registry
    from dissectors.kit import Array


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
    bits: Array

    @classmethod
    def of(cls, batch: Batch) -> Measured:
        """Measure a batch, unless its core has done so."""
        bits = batch.bit_times
        return cls(batch, bit_times(FrameTable(batch.frames)) if bits is None else bits)


class Check:
    """Adds up batches of one capture, first `measured` and then fed; memory is bounded.

    Args:
        registry: the types that the capture is decoded with.
        settings: what is looked for.
        named: is told which frames are named.
        foreign: see `Summary`.
    """

    def __init__(
        self, registry: Registry, settings: Settings, named: TakesOccurrences | None = None,
        foreign: ForeignIds | None = None,
    ) -> None:  # fmt: skip
        self.judge = Judge(registry, settings, named)
        self._summary = Summary(registry, foreign)
        self._seen = Tracker(registry)
        self._course = Course()
        self._clock = TimeResolution()

    def measured(self, batches: Iterable[Batch]) -> Iterator[Measured]:
        """Measure what no rule is needed for: another thread may do this while `feed` judges what came before."""
        for batch in batches:
            self._summary.feed(batch)
            self._clock.feed(batch)
            yield Measured.of(batch)
            del batch  # else it would be there while the next one is made

    def feed(self, measured: Measured) -> None:
        """Add the next batch."""
        batch, bits = measured
        view = self.judge.feed(batch, bits)
        self._seen.feed(view)
        self._course.feed(view)

    def finish(self, stored: Iterable[StoredCapture], engine: Engine) -> Checked:
        """Return everything, after the last batch of the captures `stored`."""
        outcome, facts = self.judge.finish(), self._summary.finish(stored, engine)
        return Checked(facts, outcome, self._seen.finish(), self._course, self._summary.names, self._clock.coarse)
