"""A SocketCAN interface: python-can opens and binds the socket, the native core empties it."""

from __future__ import annotations

import errno
import os
import socket
import time
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from analyzer._native import Drain
from analyzer.live import links, remarks
from analyzer.live.interfaces import InterfaceError, close_bus, open_bus
from analyzer.live.watching import LOOK, Journal, Retry, lasting

if TYPE_CHECKING:
    from collections.abc import Callable

    import can

    from analyzer._native import Piece
    from analyzer.live.filters import Filters
    from analyzer.live.interfaces import Interface

# Bytes asked for; the kernel counts twice as many, and 768 for a classic frame.
BUFFER = 4 << 20
_CLASSIC = 768
_GONE = (errno.ENODEV, errno.ENXIO)
_LONGEST_FRAME = 72


class SocketCan:
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
        self._drain: Drain | None = None
        self._index: int | None = None
        self._since: float | None = None  # down or gone
        self._looked = 0.0
        self._open()
        self._tell_buffer()
        if self._since is not None:
            self._journal.say(f"is down, waiting (ip link set {self.name} up)")

    def receive(self, seconds: float) -> Piece | None:
        """What has come, after waiting for it at most so long; errors of the interface become comments."""
        if (piece := self._journal.take()) is not None or self.failed is not None:
            return piece
        if self._drain is None:
            self._return(seconds)
        else:
            self._drain_for(seconds, self._drain)
            self._tell_stamps(self._drain)
        return self._journal.take()

    def finish(self) -> list[Piece]:
        """What is still there, and the losses that no frame told."""
        if self._drain is not None:
            self._drain.finish()
            self._keep(self._drain)
        return self._journal.rest()

    def wake(self) -> None:
        """Ends the wait of another thread."""
        if (drain := self._drain) is not None:
            drain.wake()

    def notes(self) -> list[str]:
        """What is new for people."""
        return self._journal.notes()

    def close(self) -> None:
        """The socket is closed; nothing more can be received."""
        self._drain = None
        if self._bus is not None:
            close_bus(self._bus)
            self._bus = None

    def _drain_for(self, seconds: float, drain: Drain) -> None:
        try:
            drain.receive(round(seconds * 1000))
        except OSError as error:
            self._failed_with(error, drain)
            return
        self._retry.work(self._now())
        if not drain.waiting and drain.drops_now() > drain.dropped:
            drain.finish()  # frames were lost, and none has come since that would tell
        self._keep(drain)
        if self._since is not None and self._due():
            link = self._link(lambda link: link.index == self._index)
            if link is not None and link.up:
                self._come_up()

    def _keep(self, drain: Drain) -> None:
        """What was received is the next to go out; with frames in it the link is up again, if it was down."""
        if drain.waiting:
            piece = drain.take()
            if self._since is not None and piece.frames:
                self._come_up(remarks.first_time(piece))
            self._journal.add(piece)

    def _open(self) -> None:
        bus: Any = open_bus(self._interface)
        try:
            if self._filters:
                # python-can binds it without filters: receiving begins with `apply`.
                self._filters.hold(bus.socket)
                _empty(bus.socket)
                self._filters.apply(bus.socket)
            drain = Drain(bus.fileno(), self.name, buffer=BUFFER, hardware=self._hardware)
        except OSError as error:
            close_bus(bus)
            raise InterfaceError(self.name, error.strerror or str(error)) from None
        self._bus, self._drain = bus, drain
        link = self._link(lambda link: link.name == self._interface.channel)
        self._index = link.index if link else None
        self._since = self._now() if link and not link.up else None

    def _tell_buffer(self) -> None:
        granted = self._drain.buffer if self._drain is not None else 0
        less = "" if granted >= 2 * BUFFER else ", less than asked for: that takes CAP_NET_ADMIN or net.core.rmem_max"
        self._journal.note(f"receive buffer of {granted:,} bytes, {granted // _CLASSIC:,} classic frames{less}")

    def _tell_stamps(self, drain: Drain | None) -> None:
        """Which clock it turned out to be."""
        if not self._untold or drain is None or not any(drain.stamped.values()):
            return
        self._untold = False
        own = drain.stamped["hardware"]
        told = "times are those of the controller" if own else "the controller stamps no frames: times are the kernel's"
        self._journal.note(told)

    def _failed_with(self, error: OSError, drain: Drain) -> None:
        """The drain tells an error when everything that came before it has been taken."""
        now = self._now()
        if error.errno == errno.ENETDOWN:
            if self._since is None:
                self._since = now
                self._journal.say("link down")
            return
        drain.finish()
        if drain.waiting:
            self._journal.add(drain.take())
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
        """Opens it again if it is there."""
        if not self._due():
            time.sleep(min(seconds, LOOK))
            return
        since, now = self._since or 0.0, self._now()
        with suppress(InterfaceError):
            if self._link(lambda link: link.name == self._interface.channel) is not None:
                self._open()
                still = "" if self._since is None else ", still down"
                self._journal.say(f"back after {lasting(now - since)}{still}")

    def _come_up(self, t: int | None = None) -> None:
        away = lasting(self._now() - (self._since or 0.0))
        self._since = None
        self._journal.say(f"link up after {away}", t)

    def _due(self) -> bool:
        """Whether it is time for another look."""
        now = self._now()
        if now - self._looked < LOOK or self._retry.wait(now):
            return False
        self._looked = now
        return True

    @staticmethod
    def _link(fits: Callable[[links.Link], bool]) -> links.Link | None:
        try:
            return next(filter(fits, links.links()), None)
        except OSError:
            return None


def _reason(error: OSError) -> str:
    return error.strerror or (os.strerror(error.errno) if error.errno else str(error))


def _empty(waiting: socket.socket) -> None:
    """Throws away what came in before; that the interface is down is asked for anyway."""
    while True:
        try:
            waiting.recv(_LONGEST_FRAME, socket.MSG_DONTWAIT)
        except BlockingIOError:
            return
        except OSError as error:
            if error.errno != errno.ENETDOWN:
                raise
