"""A clock for what waits: time passes only in its sleeps."""

from __future__ import annotations

SECOND = 1_000_000_000


class Clock:
    """Each sleep is a little too long, as real ones are."""

    def __init__(self, over: int = 0) -> None:
        self.now, self.over = 1_000_000_000_000, over
        self.slept: list[float] = []

    def __call__(self) -> int:
        return self.now

    def sleep(self, seconds: float) -> None:
        assert seconds > 0
        self.slept.append(seconds)
        self.now += round(seconds * SECOND) + self.over
