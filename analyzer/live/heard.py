"""The moments at which senders were heard, by the clock: known as frames come, long before these are judged."""

from __future__ import annotations

import time
from threading import Lock
from typing import TYPE_CHECKING

import numpy as np

from analyzer.tables import EXTENDED

if TYPE_CHECKING:
    from collections.abc import Callable

    from analyzer._native import FrameBatch

_NODE = 0x7F


class HeardSenders:
    """Follows the nodes that send frames with 29-bit identifiers, on every bus. Safe for two threads.

    Args:
        clock: nanoseconds since any moment.
    """

    def __init__(self, clock: Callable[[], int] = time.monotonic_ns) -> None:
        self._clock = clock
        self._last: dict[tuple[str, int], int] = {}
        self._lock = Lock()

    def feed(self, batch: FrameBatch) -> None:
        """Take the frames that have come now."""
        if not batch.frames:
            return
        now, (frames, _) = self._clock(), batch.columns()
        number, flags = np.frombuffer(frames["id"], "=u4"), np.frombuffer(frames["flags"], "=u2")
        sender = np.frombuffer(frames["bus"], "=u1").astype(np.uint32) << 7 | number & _NODE
        found = np.unique(sender[flags & EXTENDED != 0]).tolist()
        with self._lock:
            self._last.update(((batch.buses[one >> 7], one & _NODE), now) for one in found)

    def ages(self) -> dict[tuple[str, int], int]:
        """Return how long ago (ns) each was heard, by the names of buses and the numbers of nodes."""
        now = self._clock()
        with self._lock:
            return {sender: now - last for sender, last in self._last.items()}
