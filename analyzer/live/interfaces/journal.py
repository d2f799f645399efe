"""Events of an interface besides frames, told to people and to the recording; and when to try again."""

from __future__ import annotations

import time
from collections import deque
from typing import TYPE_CHECKING

from analyzer.live import remarks

if TYPE_CHECKING:
    from collections.abc import Callable

    from analyzer._native import FrameBatch

# Seconds between two looks at an interface that is down or gone.
LOOK = 0.25
# Seconds: the first and the longest pause between two attempts; how long it has to work to count as repaired; and how
# long it may fail.
SHORTEST, LONGEST, CALM, LIMIT = 0.1, 5.0, 5.0, 60.0


class Journal:
    """The rows that go out of one interface, in order, and notes about it, which another thread may read."""

    def __init__(self, name: str, clock: Callable[[], int] = time.time_ns) -> None:
        self._name, self._clock = name, clock
        self._notes: deque[str] = deque()
        self._batches: deque[FrameBatch] = deque()

    def note(self, text: str) -> None:
        """Tell people alone."""
        self._notes.append(f"{self._name}: {text}")

    def say(self, text: str, t: int | None = None) -> None:
        """Tell people, and the stream by a comment, with the time of now if no other one is given (ns since 1970)."""
        self.note(text)
        self.add(remarks.make_comment(self._clock() if t is None else t, f"{self._name}: {text}", self._name))

    def add(self, batch: FrameBatch) -> None:
        """Put rows behind what is there."""
        self._batches.append(batch)

    def notes(self) -> list[str]:
        """Return the lines that are new for people."""
        return [self._notes.popleft() for _ in range(len(self._notes))]

    def take(self) -> FrameBatch | None:
        """Return the next rows for the stream."""
        return self._batches.popleft() if self._batches else None

    def rest(self) -> list[FrameBatch]:
        """Return all rows for the stream."""
        return [self._batches.popleft() for _ in range(len(self._batches))]


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
        """Note a failure; False if it has been failing for longer than `LIMIT` s."""
        self._works = None
        if self._first is None:
            self._first, self._pause = now, SHORTEST
        else:
            self._pause = min(2 * self._pause, LONGEST)
        self._last, self._next = now, now + self._pause
        return self.lasted < LIMIT

    def work(self, now: float) -> None:
        """Note that it did not fail."""
        if self._works is None:
            self._works = now
        if now - self._works > CALM:
            self._first = None

    @property
    def lasted(self) -> float:
        """Seconds from the first failure of the series to the last one."""
        return self._last - self._first if self._first is not None else 0.0

    def wait(self, now: float) -> float:
        """Return the seconds until the next attempt."""
        return max(0.0, self._next - now)


def say_duration(seconds: float) -> str:
    """Return a duration in words."""
    return f"{seconds:.1f} s" if seconds < 60 else f"{seconds / 60:.1f} min"
