"""A statistic: an accumulator over rows chosen of a capture, and the end that it is told."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any, Protocol

from analyzer.facts.recording import mixed
from analyzer.tables import STAMPS
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from analyzer.decode.engine import Engine
    from analyzer.facts.summary import StoredCapture
    from analyzer.stats.chosen import ChosenBatch
    from analyzer.stats.table import StatTable
    from dissectors import Registry


class StatPart(Protocol):
    """A part that several statistics may have in common: it is fed once."""

    def feed(self, batch: ChosenBatch) -> None:
        """Add the next batch."""


@dataclass(frozen=True, slots=True)
class FoundBreach:
    """A finding as far as it is counted: `who` is what people call its sender, times are nanoseconds."""

    rule: str
    severity: str
    category: str
    title: str
    count: int
    who: str
    first: int | None
    last: int | None


@dataclass(frozen=True, slots=True)
class StatEnd:
    """The end of a capture, and what is known then. `start` and `end` are its first and last time, in nanoseconds.

    `findings` are those of `check`, if a statistic asked for them; `bit_rate` is in bits a second.
    """

    registry: Registry
    engine: Engine
    stored: Sequence[StoredCapture]
    bit_rate: int
    start: int | None
    end: int | None
    findings: Sequence[FoundBreach] = ()

    @property
    def timed(self) -> bool:
        """Return whether times can be compared with each other."""
        kinds = [name for bit, name in enumerate(STAMPS) if self.engine.stamps >> bit & 1]
        return self.start is not None and not mixed(kinds)

    @property
    def buses(self) -> Sequence[str]:
        """Interface names by index."""
        return self.engine.buses


class Statistic(ABC):
    """Adds up batches: `feed(batch)`, then `finish(end)` for its tables.

    `parts` are fed before it, each once; one that `judges` needs the findings of `check`. `autopilot` says after
    `finish` what became of an autopilot's log: its name, a `text`, and `parts`, none if it could not be aligned.
    """

    parts: Sequence[StatPart] = ()
    judges = False
    autopilot: Mapping[str, Any] | None = None

    def feed(self, batch: ChosenBatch) -> None:  # noqa: B027 - some need no more than their parts
        """Add the next batch."""

    @abstractmethod
    def finish(self, end: StatEnd) -> Sequence[StatTable]:
        """Return what was found, after the last batch."""


def percent(part: float, whole: float) -> float:
    """Return a share in percent, 0 of nothing."""
    return 100 * part / whole if whole else 0.0
