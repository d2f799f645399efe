"""Any other interface of python-can: messages one by one, with the time stamps that its driver gives, or the host's."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from analyzer._native import Rows
from analyzer.live.interfaces.journal import Journal, Retry, say_duration
from analyzer.live.interfaces.naming import InterfaceError, close_bus, first_line, open_bus
from analyzer.sources.can_rows import ABSOLUTE, BUS_ERROR, MICROSECONDS, Unreadable, add, from_float, rounded
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Callable

    import can

    from analyzer._native import FrameBatch
    from analyzer.live.interfaces.filters import Filters
    from analyzer.live.interfaces.naming import Interface

# Messages that one call takes at most.
BATCH = 1024
# The identifier of an error frame holds its class bits only with these; other drivers have numbers of their own there.
_CLASSES = ("virtual", "udp_multicast", "socketcand")
# A driver whose time is further off than this counts from somewhere else.
_FAR = 3600 * SECOND


class DriverReceiver:
    """`Receiver` of an interface that python-can receives from. A driver that fails is opened again.

    It is given up after a while if it has never worked; a device that was pulled out is waited for.

    Args:
        interface: which one.
        filters: applied to each message here, so that all of them mean the same with every driver.
        clock: nanoseconds since 1970.
        now: seconds of a monotonic clock.
        sleep: waits so many seconds.

    Raises `InterfaceError` if it cannot be opened.
    """

    def __init__(
        self,
        interface: Interface,
        filters: Filters,
        clock: Callable[[], int] = time.time_ns,
        now: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self.name = interface.name
        self.failed: str | None = None
        self._interface, self._filters = interface, filters
        self._clock, self._now, self._sleep = clock, now, sleep
        self._journal, self._retry = Journal(self.name, clock), Retry()
        self._rows = Rows()
        self._own_clock = True
        self._broken: float | None = None
        self._worked = False
        self._bus: can.BusABC | None = open_bus(interface)

    def receive(self, seconds: float) -> FrameBatch | None:
        """Return the rows that have come, after waiting for them at most so long."""
        if (batch := self._journal.take()) is not None or self.failed is not None:
            return batch
        if (pause := self._retry.wait(self._now())) and self._broken is not None:
            self._sleep(min(pause, seconds))
            return None
        try:
            if self._bus is None:
                self._bus = open_bus(self._interface)
            self._take(self._bus, seconds)
        except Exception as error:  # noqa: BLE001 - each driver fails in its own way
            self._keep()
            self._fail(error)
        else:
            self._retry.work(self._now())
            if self._broken is not None:
                self._journal.say(f"works again after {say_duration(self._now() - self._broken)}")
                self._broken = None
            self._keep()
        return self._journal.take()

    def finish(self) -> list[FrameBatch]:
        """Return the rows that are still there: no more than the comments about the interface."""
        return self._journal.rest()

    def wake(self) -> None:
        """Do nothing: drivers cannot be woken, `receive` ends with its time."""

    def notes(self) -> list[str]:
        """Return the lines that are new for people."""
        return self._journal.notes()

    def close(self) -> None:
        """Make the driver let go of the device."""
        if self._bus is not None:
            close_bus(self._bus)
            self._bus = None

    def _take(self, bus: can.BusABC, seconds: float) -> None:
        """Receive all that comes in this time: one by one it would cost more to pass on than to receive."""
        end, left = self._now() + seconds, seconds
        for _ in range(BATCH):
            message = bus.recv(left)
            self._worked = True
            if message is None:
                return
            self._add(message)
            left = max(0.0, end - self._now())

    def _add(self, message: can.Message) -> None:
        class_ = None
        if message.is_error_frame:
            class_ = (self._interface.kind in _CLASSES and message.arbitration_id) or BUS_ERROR
        if not self._filters.take(message, class_ or 0):
            return
        try:
            add(self._rows, message, self._time(message), self.name, class_)
            self._rows.stamp(ABSOLUTE | MICROSECONDS)
        except Unreadable as error:
            self._rows.unreadable(f"{self.name}: {error}")

    def _time(self, message: can.Message) -> int:
        """Return the driver's time (ns) if it is that of a clock that was set, else the host's."""
        host = self._clock()
        try:
            t = from_float(message.timestamp)
        except Unreadable:
            t = 0
        if abs(t - host) < _FAR:
            return t
        if self._own_clock:
            self._own_clock = False
            told = "no time stamps" if not t else "time stamps that do not count from 1970"
            self._journal.say(f"its driver gives {told}: times are those of the moment when a frame was read")
        return rounded(host, 1000)

    def _keep(self) -> None:
        if self._rows.waiting:
            self._journal.add(self._rows.take())

    def _fail(self, error: Exception) -> None:
        """Give the driver another chance as it is the first time; then have it opened anew each time."""
        reason, now = error.reason if isinstance(error, InterfaceError) else first_line(error), self._now()
        if not self._retry.fail(now) and not self._worked:
            self.failed = f"{reason}; given up after {say_duration(self._retry.lasted)}"
            self._journal.say(self.failed)
        elif self._broken is None:
            self._broken = now
            self._journal.say(f"{reason}; trying again")
            return
        self.close()
