"""A SocketCAN interface: python-can opens and binds the socket, the native core empties it."""

from __future__ import annotations

import errno
import os
import socket
import time
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from analyzer._native import SocketReceiver
from analyzer.live import remarks
from analyzer.live.interfaces import links
from analyzer.live.interfaces.journal import LOOK, Journal, Retry, say_duration
from analyzer.live.interfaces.naming import InterfaceError, close_bus, open_bus
from dissectors.records import replace

if TYPE_CHECKING:
    from collections.abc import Callable

    import can

    from analyzer._native import FrameBatch
    from analyzer.live.interfaces.filters import Filters
    from analyzer.live.interfaces.naming import Interface

# Bytes asked for; the kernel counts twice as many, and 768 for a classic frame.
BUFFER = 4 << 20
_CLASSIC = 768
# Seconds between two looks at its name.
_RENAMED = 1.0
_GONE = (errno.ENODEV, errno.ENXIO)
_LONGEST_FRAME = 72


class SocketCanReceiver:
    """`Receiver` of a SocketCAN interface. It outlasts the interface: down, it waits; removed, it opens it again.

    Args:
        interface: which one; it is opened with CAN FD in any case, which classic interfaces take as well.
        filters: for the kernel.
        clock: nanoseconds since 1970.
        now: seconds of a monotonic clock.
        hardware: times are those of the controller's clock, wherever it starts, if it has one.

    Raises `InterfaceError` if it cannot be opened.
    """

    def __init__(
        self,
        interface: Interface,
        filters: Filters,
        clock: Callable[[], int] = time.time_ns,
        now: Callable[[], float] = time.monotonic,
        *,
        hardware: bool = False,
    ) -> None:
        self.name = interface.name
        self._hardware, self._untold = hardware, hardware
        self.failed: str | None = None
        self._interface = replace(interface, options={**interface.options, "fd": True})
        self._filters, self._now = filters, now
        self._journal, self._retry = Journal(self.name, clock), Retry()
        self._bus: can.BusABC | None = None
        self._socket: SocketReceiver | None = None
        self._index: int | None = None
        self._called, self._asked = "", 0.0
        self._since: float | None = None  # down or gone
        self._looked = 0.0
        self._open()
        self._tell_buffer()
        if self._since is not None:
            self._journal.say(f"is down, waiting (ip link set {self.name} up)")

    def receive(self, seconds: float) -> FrameBatch | None:
        """Return the rows that have come, after waiting at most so long; errors of the interface become comments."""
        if (batch := self._journal.take()) is not None or self.failed is not None:
            return batch
        if self._socket is None:
            self._return(seconds)
        else:
            self._receive_for(seconds, self._socket)
            self._tell_stamps(self._socket)
        return self._journal.take()

    def finish(self) -> list[FrameBatch]:
        """Return the rows that are still there, and the losses that no frame told."""
        if self._socket is not None:
            self._socket.finish()
            self._keep(self._socket)
        return self._journal.rest()

    def wake(self) -> None:
        """End the wait of another thread."""
        if (native := self._socket) is not None:
            native.wake()

    def notes(self) -> list[str]:
        """Return the lines that are new for people."""
        return self._journal.notes()

    def close(self) -> None:
        """Close the socket; nothing more can be received."""
        self._socket = None
        if self._bus is not None:
            close_bus(self._bus)
            self._bus = None

    def _receive_for(self, seconds: float, native: SocketReceiver) -> None:
        try:
            native.receive(round(seconds * 1000))
        except OSError as error:
            self._failed_with(error, native)
            return
        self._retry.work(self._now())
        self._tell_name()
        if not native.waiting and native.drops_now() > native.dropped:
            native.finish()  # frames were lost, and none has come since that would tell
        self._keep(native)
        if self._since is not None and self._due():
            link = self._link(lambda link: link.index == self._index)
            if link is not None and link.up:
                self._come_up()

    def _keep(self, native: SocketReceiver) -> None:
        """Pass on what was received; with frames in it the link is up again, if it was down."""
        if native.waiting:
            batch = native.take()
            if self._since is not None and batch.frames:
                self._come_up(remarks.first_time(batch))
            self._journal.add(batch)

    def _open(self) -> None:
        bus: Any = open_bus(self._interface)
        try:
            if self._filters:
                # python-can binds it without filters: receiving begins with `apply`.
                self._filters.hold(bus.socket)
                _empty(bus.socket)
                self._filters.apply(bus.socket)
            native = SocketReceiver(bus.fileno(), self.name, buffer=BUFFER, hardware=self._hardware)
        except OSError as error:
            close_bus(bus)
            raise InterfaceError(self.name, error.strerror or str(error)) from None
        self._bus, self._socket = bus, native
        link = self._link(lambda link: link.name == self._interface.channel)
        self._index = link.index if link else None
        self._called = str(self._interface.channel)
        self._since = self._now() if link and not link.up else None

    def _tell_buffer(self) -> None:
        granted = self._socket.buffer if self._socket is not None else 0
        less = "" if granted >= 2 * BUFFER else ", less than asked for: that takes CAP_NET_ADMIN or net.core.rmem_max"
        self._journal.note(f"receive buffer of {granted:,} bytes, {granted // _CLASSIC:,} classic frames{less}")

    def _tell_name(self) -> None:
        """Tell that somebody has renamed the interface: the socket stays with it."""
        now = self._now()
        if self._index is None or now - self._asked < _RENAMED:
            return
        self._asked = now
        with suppress(OSError):
            name = socket.if_indextoname(self._index)
            if name != self._called:
                self._journal.say(f"is called {name} now")
                self._called = name

    def _tell_stamps(self, native: SocketReceiver | None) -> None:
        """Tell which clock it turned out to be."""
        if not self._untold or native is None or not any(native.stamped.values()):
            return
        self._untold = False
        own = native.stamped["hardware"]
        told = "times are those of the controller" if own else "the controller stamps no frames: times are the kernel's"
        self._journal.note(told)

    def _failed_with(self, error: OSError, native: SocketReceiver) -> None:
        """Deal with an error, which the native receiver tells when everything before it has been taken."""
        now = self._now()
        if error.errno == errno.ENETDOWN:
            if self._since is None:
                self._since = now
                self._journal.say("link down")
            return
        native.finish()
        if native.waiting:
            self._journal.add(native.take())
        if error.errno in _GONE:
            self._journal.say("removed, waiting for it to come back")
        elif self._retry.fail(now):
            self._journal.say(f"{_reason(error)}; opening it again")
        else:
            self.failed = f"{_reason(error)}, again and again"
            self._journal.say(self.failed)
        self._since = now
        self.close()

    def _return(self, seconds: float) -> None:
        """Open it again if it is there."""
        if not self._due():
            time.sleep(min(seconds, LOOK))
            return
        since, now = self._since or 0.0, self._now()
        with suppress(InterfaceError):
            if self._link(lambda link: link.name == self._interface.channel) is not None:
                self._open()
                still = "" if self._since is None else ", still down"
                self._journal.say(f"back after {say_duration(now - since)}{still}")

    def _come_up(self, t: int | None = None) -> None:
        away = say_duration(self._now() - (self._since or 0.0))
        self._since = None
        self._journal.say(f"link up after {away}", t)

    def _due(self) -> bool:
        """Return True if it is time for another look."""
        now = self._now()
        if now - self._looked < LOOK or self._retry.wait(now):
            return False
        self._looked = now
        return True

    @staticmethod
    def _link(fits: Callable[[links.Link], bool]) -> links.Link | None:
        try:
            return next(filter(fits, links.list_links()), None)
        except OSError:
            return None


def _reason(error: OSError) -> str:
    return error.strerror or (os.strerror(error.errno) if error.errno else str(error))


def _empty(waiting: socket.socket) -> None:
    """Throw away what came in before; that the interface is down is asked for anyway."""
    while True:
        try:
            waiting.recv(_LONGEST_FRAME, socket.MSG_DONTWAIT)
        except BlockingIOError:
            return
        except OSError as error:
            if error.errno != errno.ENETDOWN:
                raise
