"""One bus: frames wait, the lowest identifier goes first, nobody interrupts a frame (ISO 11898-1 arbitration)."""

from __future__ import annotations

from heapq import heappop, heappush
from typing import TYPE_CHECKING

from analyzer.simulate.bits import INTERMISSION, arbitration, duration

if TYPE_CHECKING:
    from dissectors.traffic import Frame


class Bus:
    """Frames as they follow each other; of equal identifiers the one that was sent first goes first.

    `bit_time` is in ns. `closed` is the time before which nothing can start: the end of the last frame's intermission.
    """

    def __init__(self, bit_time: int) -> None:
        self.bit_time = bit_time
        self.closed = 0
        self._count = 0
        self._waiting: list[tuple[int, int, Frame]] = []

    def put(self, frame: Frame) -> None:
        """The frame competes from now on."""
        self._count += 1
        heappush(self._waiting, (arbitration(frame), self._count, frame))

    def block(self, until: int) -> None:
        """Nothing can be sent before `until`."""
        self.closed = max(self.closed, until)

    def drop(self) -> None:
        """Gives up all that waits."""
        self._waiting.clear()

    def next(self, now: int, before: int) -> Frame | None:
        """The next frame, if it starts before `before`; `t` is its end. All that waits was put at `now` or earlier."""
        start = max(self.closed, now)
        if not self._waiting or start >= before:
            return None
        frame = heappop(self._waiting)[2]
        self.closed = start + duration(frame, self.bit_time)
        frame.t = self.closed - INTERMISSION * self.bit_time
        return frame
