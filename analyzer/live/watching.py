"""What happens to an interface besides frames: said to people and to the recording, and when to try again."""

from __future__ import annotations

import time
from collections import deque
from typing import TYPE_CHECKING

from analyzer.live import remarks

if TYPE_CHECKING:
    from collections.abc import Callable

    from analyzer._native import Piece

# Seconds between two looks at an interface that is down or gone.
LOOK = 0.25
# Seconds: the first and the longest pause between two attempts; how long it has to work to count as repaired; and how
# long it may fail.
SHORTEST, LONGEST, CALM, LIMIT = 0.1, 5.0, 5.0, 60.0


class Journal:
    """What goes out of one interface, in order, and what there is to say of it, which another thread may read."""

    def __init__(self, name: str, clock: Callable[[], int] = time.time_ns) -> None:
        self._name, self._clock = name, clock
        self._notes: deque[str] = deque()
        self._pieces: deque[Piece] = deque()

    def note(self, text: str) -> None:
        """For people alone."""
        self._notes.append(f"{self._name}: {text}")

    def say(self, text: str, t: int | None = None) -> None:
        """For people, and as a comment in the stream, with the time of now if no other one is given (ns since 1970)."""
        self.note(text)
        self.add(remarks.comment(self._clock() if t is None else t, f"{self._name}: {text}", self._name))

    def add(self, piece: Piece) -> None:
        """Puts rows behind what is there."""
        self._pieces.append(piece)

    def notes(self) -> list[str]:
        """What is new for people."""
        return [self._notes.popleft() for _ in range(len(self._notes))]

    def take(self) -> Piece | None:
        """The next rows for the stream."""
        return self._pieces.popleft() if self._pieces else None

    def rest(self) -> list[Piece]:
        """All of them."""
        return [self._pieces.popleft() for _ in range(len(self._pieces))]


class Retry:
    """Attempts with growing pauses. A series of failures ends only when it has worked for `CALM` s.

    All times are those of a monotonic clock, in seconds.
    """

    def __init__(self) -> None:
        self._first: float | None = None
        self._works: float | None = None
        self._last = self._next = 0.0
        self._pause = SHORTEST

    def fail(self, now: float) -> bool:
        """It failed; False if it has been doing so for longer than `LIMIT` s."""
        self._works = None
        if self._first is None:
            self._first, self._pause = now, SHORTEST
        else:
            self._pause = min(2 * self._pause, LONGEST)
        self._last, self._next = now, now + self._pause
        return self.lasted < LIMIT

    def work(self, now: float) -> None:
        """It did not fail."""
        if self._works is None:
            self._works = now
        if now - self._works > CALM:
            self._first = None

    @property
    def lasted(self) -> float:
        """Seconds from the first failure of the series to the last one."""
        return self._last - self._first if self._first is not None else 0.0

    def wait(self, now: float) -> float:
        """Seconds until the next attempt."""
        return max(0.0, self._next - now)


def lasting(seconds: float) -> str:
    """A duration in words."""
    return f"{seconds:.1f} s" if seconds < 60 else f"{seconds / 60:.1f} min"
