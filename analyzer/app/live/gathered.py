"""Batches of a live session that are shown already, until they are judged as one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.decode.core import BATCH_ROWS
from analyzer.decode.joined import joined

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from analyzer.app.live.batch_interval import BatchInterval
    from analyzer.decode.engine import Batch


class Gathered:
    """Gathers them as long as an interval says, which grows where judging takes long; a batch of rows at most.

    Args:
        interval: None if batches are judged at once.
        now: seconds of a monotonic clock.
    """

    def __init__(self, interval: BatchInterval | None, now: Callable[[], float]) -> None:
        self._interval, self._now = interval, now
        self._batches: list[Batch] = []
        self._rows = 0
        self._since = now()  # the last time that they were judged

    def add(self, batch: Batch) -> None:
        """Add the next one."""
        self._batches.append(batch)
        self._rows += len(batch.frames)

    @property
    def due(self) -> bool:
        """True once they are to be judged."""
        if not self._batches or self._interval is None:
            return bool(self._batches)
        return self._rows >= BATCH_ROWS or self._now() - self._since >= self._interval.seconds

    def take(self) -> Iterator[Batch]:
        """Yield what was gathered as one batch, if there is any; whoever takes it is timed."""
        if not self._batches:
            return
        start, parts = self._now(), self._batches
        self._batches, self._rows = [], 0
        batch = joined(parts)
        del parts  # they are large
        yield batch
        self._since = self._now()
        if self._interval is not None:
            self._interval.took(self._since - start)
