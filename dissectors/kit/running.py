"""How long motors turned."""

from __future__ import annotations

from dissectors.times import NO_TIME


class RunningTime:
    """Adds up how long motors turned on each bus, in nanoseconds; `end` is the time so far."""

    def __init__(self) -> None:
        self.end = NO_TIME
        self._since: dict[int, int] = {}  # of buses on which motors turn
        self._ran: dict[int, int] = {}

    def note(self, bus: int, t: int, *, turning: bool) -> None:
        """Note that motors of a bus began to turn, or that the last one stopped."""
        if turning:
            self._since[bus] = t
        elif bus in self._since:
            self._ran[bus] = self._ran.get(bus, 0) + max(t - self._since.pop(bus), 0)

    @property
    def longest(self) -> int:
        """Time with motors turning, on the bus with the most: buses may repeat each other."""
        going_on = {bus: max(self.end - since, 0) for bus, since in self._since.items()}
        return max(
            (self._ran.get(bus, 0) + going_on.get(bus, 0) for bus in self._ran.keys() | going_on.keys()), default=0
        )
