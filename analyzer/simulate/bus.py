"""One bus: frames wait, the lowest identifier goes first, nobody interrupts a frame (ISO 11898-1 arbitration)."""

from __future__ import annotations

from heapq import heappop, heappush
from typing import TYPE_CHECKING

from analyzer.simulate.bits import INTERMISSION, arbitration, duration

if TYPE_CHECKING:
    from dissectors.traffic import SimulatedFrame


class SimulatedBus:
    """Frames as they follow each other; of equal identifiers the one that was sent first goes first.

    `bit_time` is in ns. `closed` is the time before which nothing can start: the end of the last frame's intermission.
    """

    def __init__(self, bit_time: int) -> None:
        self.bit_time = bit_time
        self.closed = 0
        self._count = 0
        self._waiting: list[tuple[int, int, SimulatedFrame]] = []

    def put(self, frame: SimulatedFrame) -> None:
        """Let the frame compete from now on."""
        self._count += 1
        heappush(self._waiting, (arbitration(frame), self._count, frame))

    def block(self, until: int) -> None:
        """Let nothing be sent before `until`."""
        self.closed = max(self.closed, until)

    def drop(self) -> None:
        """Give up all that waits."""
        self._waiting.clear()

    def next(self, now: int, before: int) -> SimulatedFrame | None:
        """Return the next frame if it starts before `before`; `t` is its end. All that waits is of `now` or before."""
        start = max(self.closed, now)
        if not self._waiting or start >= before:
            return None
        frame = heappop(self._waiting)[2]
        self.closed = start + duration(frame, self.bit_time)
        frame.t = self.closed - INTERMISSION * self.bit_time
        return frame
