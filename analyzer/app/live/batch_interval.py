"""How long a live session gathers rows for one batch: what a bus full of faults costs, it costs for each batch."""

from __future__ import annotations

import math

# A batch waits so many times as long as the last one took: judging and showing are 4 % of the time then, which is 5 us
# a frame on a full bus.
_PATIENCE = 24
# By how much it may be longer than the last one: a single batch that was slow makes no long one.
_GROWTH = 1.25


class BatchInterval:
    """The time between two batches, in seconds: the shortest one, longer where batches take long.

    Args:
        shortest: how often somebody wants to see what comes.
        longest: how long it may be in no case.
        most: how many seconds a batch may take, if it is not the shortest one.
    """

    def __init__(self, shortest: float, longest: float, most: float = math.inf) -> None:
        self.seconds = self._shortest = shortest
        self._longest, self._most = longest, most

    def took(self, busy: float) -> None:
        """Take the seconds that the last batch took, and choose the next interval by them."""
        growth = _GROWTH if busy * _GROWTH <= self._most else min(self._most / busy, 1)
        wanted = min(_PATIENCE * busy, self.seconds * growth, self._longest)
        self.seconds = max(wanted, self._shortest)
