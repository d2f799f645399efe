"""Messages that come at a steady pace, and that pace: the rest is sent as it is needed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.facts.traffic import MOST_TALKS, times
from analyzer.tables import KINDS
from dissectors.kit.cells import numbers
from dissectors.records import dataclass
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from analyzer.decode.engine import Batch
    from dissectors.kit import Array


FEWEST = 8  # transfers that show a pace
JITTER = 0.35  # standard deviation of the time from one to the next, in periods
LONGEST = 5.0  # periods without one, such as lost frames leave
THROUGHOUT = 0.9  # of the capture, from the first to the last
_MESSAGE = KINDS.index("message")

Key = tuple[int, int, int]  # bus, node, type ID


@dataclass(slots=True)
class Pace:
    """The times of what one node sends of one type, in seconds."""

    first: int
    last: int
    gaps: int = 0
    total: float = 0.0
    squares: float = 0.0
    longest: float = 0.0

    def feed(self, gaps: Array, last: int) -> None:
        """Add times from one transfer to the next, the last of which was at `last`."""
        self.gaps += len(gaps)
        self.total += float(gaps.sum())
        self.squares += float((gaps * gaps).sum())
        self.longest = max(self.longest, float(gaps.max(initial=0.0)))
        self.last = last

    def throughout(self, span: int) -> bool:
        """Return whether it is sent from the start of a capture to its end, `span` nanoseconds long."""
        return self.gaps + 1 >= FEWEST and self.last - self.first >= THROUGHOUT * span

    @property
    def steady(self) -> bool:
        """Return whether one period describes it."""
        if self.gaps + 1 < FEWEST or self.total <= 0:
            return False
        mean = self.total / self.gaps
        spread = max(self.squares / self.gaps - mean * mean, 0.0) ** 0.5
        return spread <= JITTER * mean and self.longest <= LONGEST * mean


class Periods:
    """Adds up batches: messages of at most `MOST_TALKS` nodes and types, others are left out.

    Args:
        told: takes what is found: of whom, the times from one transfer to the next in seconds, and when each such time
            was over.
    """

    def __init__(self, told: Callable[[Key, Array, Array], None] | None = None) -> None:
        self.all: dict[Key, Pace] = {}
        self._told = told

    def over(self, batches: Iterable[Batch]) -> Iterator[Batch]:
        """Yield the batches, and add each."""
        for batch in batches:
            self.feed(batch)
            yield batch
            del batch  # it is large

    def feed(self, batch: Batch) -> None:
        """Add the next batch."""
        transfers = batch.transfers
        t, timed = times(transfers)
        rows = np.flatnonzero(timed & (numbers(transfers.column("kind")) == _MESSAGE))
        if not rows.size:
            return
        bus, src, type_id = (
            numbers(transfers.column(name))[rows].astype(np.int64) for name in ("bus", "src", "type_id")
        )
        codes = bus << 32 | src << 16 | type_id
        order = np.lexsort((t[rows], codes))
        codes, ordered = codes[order], t[rows][order]
        starts = np.flatnonzero(np.diff(codes, prepend=-1))
        for start, end in zip(starts, [*starts[1:], len(codes)], strict=True):
            self._add(int(codes[start]), ordered[start:end])

    def _add(self, code: int, t: Array) -> None:
        key = (code >> 32, code >> 16 & 0xFFFF, code & 0xFFFF)
        pace = self.all.get(key)
        if pace is None:
            if len(self.all) >= MOST_TALKS:
                return
            pace = self.all[key] = Pace(int(t[0]), int(t[0]))
            gaps = np.diff(t)
        else:
            gaps = np.diff(t, prepend=pace.last)
        gaps = np.maximum(gaps, 0) / SECOND
        pace.feed(gaps, max(int(t[-1]), pace.last))
        if self._told is not None and len(gaps):
            self._told(key, gaps, t[len(t) - len(gaps) :])
