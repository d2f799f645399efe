"""RawCommand as an ESC takes it: the last valid throttle, and what is wrong with those that came (4.4.1)."""

from __future__ import annotations

from dissectors.records import dataclass
from dissectors.times import MILLISECOND

# 4.4.1 explanation 2 gives the timeout no number.
TIMEOUT = 100 * MILLISECOND
FULL = 8191


@dataclass(slots=True)
class Throttle:
    """One channel. `raw` is the last valid command, `heard` and `valid` are in ns.

    They are the times of the last command of any kind and of the last valid one, -1 before there was one. `timeout` is
    how long it is held, in ns.
    """

    raw: int = 0
    heard: int = -1
    valid: int = -1
    abnormal: bool = False
    timeout: int = TIMEOUT

    def hear(self, command: int, now: int) -> None:
        """Take a RawCommand. A negative one is an anomaly; the last valid one is held until the timeout."""
        self.heard = now
        self.abnormal = command < 0
        if command >= 0:
            self.raw, self.valid = command, now

    def lost(self, now: int) -> bool:
        """Return if commands came and have stopped."""
        return self.heard >= 0 and now - self.heard > self.timeout

    @property
    def started(self) -> bool:
        """There ever was a command."""
        return self.heard >= 0

    def value(self, now: int) -> int:
        """Return the throttle to follow, 0 to 8191."""
        return self.raw if self.valid >= 0 and now - self.valid <= self.timeout else 0
