"""Frames on a bus at their times: paced by the monotonic clock, no faster than the bus could carry them."""

from __future__ import annotations

import errno
import time
from typing import TYPE_CHECKING, Protocol, TypeVar

import can

from analyzer.live.interfaces import InterfaceError, first_line

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

SECOND = 1_000_000_000
# A wait is cut into slices of this length, so that the end of the work is noticed.
SLICE = SECOND // 20
# Behind by more than this, time goes on from where it is instead of being caught up with.
MOST_BEHIND = SECOND
# How long a full transmit buffer is waited for, and the first and the longest pause between two attempts.
PATIENCE, SHORTEST, LONGEST = SECOND, SECOND // 10_000, SECOND // 100
# Bits of a frame besides its data, none of them stuffed, up to the next frame: 11-bit and 29-bit identifiers.
_OVERHEAD = 47, 67
_FULL = (errno.ENOBUFS, errno.EAGAIN)
_GONE = (errno.ENODEV, errno.ENXIO)


class Timed(Protocol):
    """A frame with its time in ns from the start."""

    @property
    def t(self) -> int:
        """When its last bit is sent."""

    @property
    def data(self) -> bytes:
        """Its payload."""

    @property
    def extended(self) -> bool:
        """Whether its identifier has 29 bits."""


_Frame = TypeVar("_Frame", bound=Timed)


class Pace:
    """Lets frames through at their times, the first moment of which is when the first frame is asked for.

    A frame that is late goes out as soon as the bus could carry it behind the one before, until the delay is caught up
    with. `behind` sums up delays (ns) that were too long for that: the rest of the frames is as much later.
    """

    def __init__(
        self,
        bit_rate: int,
        stopped: Callable[[], bool],
        clock: Callable[[], int] = time.monotonic_ns,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self.behind = 0
        self._bit = SECOND // bit_rate
        self._stopped, self._clock, self._sleep = stopped, clock, sleep

    def over(self, frames: Iterable[_Frame]) -> Iterator[_Frame]:
        """The frames, each at its time; ends early when `stopped` says so, before the frame that was waited for."""
        start = self._clock()
        before = start
        for frame in frames:
            length = (_OVERHEAD[frame.extended] + 8 * len(frame.data)) * self._bit
            if not self._wait(max(start + frame.t, before + length)):
                return
            before = self._clock()
            late = before - start - frame.t
            if late > MOST_BEHIND:
                start += late
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
        """Raises `InterfaceError` when that is not possible any more."""
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
