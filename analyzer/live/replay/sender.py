"""Frames on buses at their times: paced by the monotonic clock, no faster than a bus could carry them."""

from __future__ import annotations

import errno
import time
from itertools import takewhile
from typing import TYPE_CHECKING, Protocol, TypeVar

import can

from analyzer.live.interfaces.naming import InterfaceError, first_line
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

# A wait is cut into slices of this length, so that the end of the work is noticed.
SLICE = SECOND // 20
# Behind by more than this, time goes on from where it is instead of being caught up with.
MOST_BEHIND = SECOND
# What sleeps were too long is caught up with at once, up to this: as many frames as any transmit buffer takes.
BURST = SECOND // 1000
# How long a full transmit buffer is waited for, and the first and the longest pause between two attempts.
PATIENCE, SHORTEST, LONGEST = SECOND, SECOND // 10_000, SECOND // 100
# Bits of a frame besides its data, none of them stuffed, up to the next frame: 11-bit and 29-bit identifiers.
_OVERHEAD = 47, 67
# Bits of the data phase that may take the time of one, where the bit rate is switched.
_SWITCHED = 8
_FULL = (errno.ENOBUFS, errno.EAGAIN)
_GONE = (errno.ENODEV, errno.ENXIO)


class Timed(Protocol):
    """A frame with its time in ns from the start."""

    @property
    def t(self) -> int:
        """The moment when its last bit is sent."""

    @property
    def data(self) -> bytes:
        """Its payload."""

    @property
    def extended(self) -> bool:
        """True if its identifier has 29 bits."""

    @property
    def brs(self) -> bool:
        """True if its data come at a higher bit rate."""

    @property
    def bus(self) -> int:
        """Which of the buses it is for: none waits for another one."""


_Frame = TypeVar("_Frame", bound=Timed)


class Pacer:
    """Lets frames through at their times, the first moment of which is when there is a first frame.

    A frame that is late goes out as soon as its bus could carry it behind the one before, until the delay is caught up
    with. `behind` sums up delays (ns) that were too long for that: the rest of the frames is as much later. `bit_rate`
    is that of every bus; without one their times count for nothing, and frames are let through as they come.
    """

    def __init__(
        self,
        bit_rate: int | None,
        stopped: Callable[[], bool],
        clock: Callable[[], int] = time.monotonic_ns,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self.behind = 0
        self._start: int | None = None
        self._bit = None if bit_rate is None else SECOND // bit_rate
        self._stopped, self._clock, self._sleep = stopped, clock, sleep

    @property
    def elapsed(self) -> int:
        """The time (ns) on the scale of the frames; 0 before the first one, and without a bit rate."""
        return 0 if self._start is None else self._clock() - self._start

    def over(self, frames: Iterable[_Frame]) -> Iterator[_Frame]:
        """Give the frames, each at its time; end early when `stopped` says so, before the frame that is waited for."""
        if self._bit is None:
            yield from takewhile(lambda _: not self._stopped(), frames)
            return
        free: dict[int, int] = {}
        for frame in frames:
            start = self._start = self._clock() if self._start is None else self._start
            data = 8 * len(frame.data) // (_SWITCHED if frame.brs else 1)
            length = (_OVERHEAD[frame.extended] + data) * self._bit
            due = max(start + frame.t, free.get(frame.bus, start) + length)
            if not self._wait(due):
                return
            now = self._clock()
            free[frame.bus] = max(due, now - BURST)
            late = now - start - frame.t
            if late > MOST_BEHIND:
                self._start = start + late
                self.behind += late
            yield frame

    def _wait(self, until: int) -> bool:
        while not self._stopped():
            left = until - self._clock()
            if left <= 0:
                return True
            self._sleep(min(left, SLICE) / SECOND)
        return False


class Sender:
    """Puts messages on a bus; a transmit buffer that is full is waited for, within bounds."""

    def __init__(
        self,
        bus: can.BusABC,
        name: str,
        clock: Callable[[], int] = time.monotonic_ns,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._bus, self._name = bus, name
        self._clock, self._sleep = clock, sleep

    def send(self, message: can.Message) -> None:
        """Send a message. Raises `InterfaceError` when that is not possible any more."""
        pause, end = SHORTEST, 0
        while True:
            try:
                self._bus.send(message)
            except (can.CanError, OSError, ValueError) as error:
                now = self._clock()
                end = end or now + PATIENCE
                if not _full(error) or now >= end:
                    raise InterfaceError(self._name, _reason(error, self._name)) from None
            else:
                return
            self._sleep(pause / SECOND)
            pause = min(2 * pause, LONGEST)


def _number(error: Exception) -> int | None:
    return error.errno if isinstance(error, OSError) else getattr(error, "error_code", None)


def _full(error: Exception) -> bool:
    return isinstance(error, can.CanTimeoutError) or _number(error) in _FULL or "full" in str(error).lower()


def _reason(error: Exception, name: str) -> str:
    number = _number(error)
    if _full(error):
        return "its transmit buffer stays full: does anybody acknowledge, is the controller bus-off?"
    if number == errno.ENETDOWN:
        return "is down" if ":" in name else f"is down (ip link set {name} up)"
    if number in _GONE:
        return "has been removed"
    return first_line(error)
