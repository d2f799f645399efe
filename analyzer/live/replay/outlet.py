"""A bus that frames are sent to: what it takes, and what must not reach it."""

from __future__ import annotations

import socket
import time
from collections import Counter
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Protocol, Self

import can

from analyzer.live.interfaces.naming import close_bus, open_bus
from analyzer.live.replay.safety import find_doubt
from analyzer.live.replay.sender import Sender, Timed
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Callable

    from analyzer.live.interfaces.naming import Interface
    from analyzer.live.replay.safety import Guard


# Seconds between two looks whether a bus can still not be real.
AGAIN = 0.05


class Sendable(Timed, Protocol):
    """A frame with everything that goes over the bus."""

    @property
    def id(self) -> int:
        """Its identifier, 11 or 29 bits."""

    @property
    def remote(self) -> bool:
        """True if it asks for data instead of having some."""

    @property
    def dlc(self) -> int | None:
        """The length that a remote frame asks for."""

    @property
    def fd(self) -> bool:
        """True if it is a frame of CAN FD."""


class ActuationError(Exception):
    """A command that must not be sent there."""


class Outlet(AbstractContextManager["Outlet"]):
    """One bus, to be opened when it is known that it may be.

    With a `guard`, `doubt` says from the beginning why the bus may be real, and nothing is then sent there that would
    actuate something; it is empty if nothing real can be reached, or if there is no guard. That need not stay so:
    before something is sent that would actuate, it is asked again, every `AGAIN` seconds at most. `sent` counts frames,
    `left_out` those that cannot be sent, in words.

    Args:
        interface: which bus.
        guard: knows what actuates; None if everything may be sent.
        clock: seconds of a monotonic clock.

    Entering it raises `InterfaceError` for a SocketCAN interface that is not there: that is another mistake, and
    opening one changes nothing on the bus.
    """

    def __init__(
        self, interface: Interface, guard: Guard | None, clock: Callable[[], float] = time.monotonic
    ) -> None:  # fmt: skip
        self.interface = interface
        self.doubt = ""
        self.sent = 0
        self.left_out: Counter[str] = Counter()
        self._guard, self._clock = guard, clock
        self._asked, self._index = 0.0, 0
        self._bus: can.BusABC | None = None

    def __enter__(self) -> Self:
        """Find out what it is."""
        if self.interface.kind == "socketcan":
            self.open()
        if self._guard is not None:
            self._index = _index(self.interface)
            self._ask(self.interface)
        return self

    def __exit__(self, *_: object) -> None:
        """Close it."""
        if self._bus is not None:
            close_bus(self._bus)

    def open(self) -> None:
        """Open the bus; from here on it can send. Raises `InterfaceError`."""
        if self._bus is None:
            self._bus = open_bus(self.interface)
            self._sender = Sender(self._bus, self.interface.name)
            self._fd = _takes_fd(self._bus, self.interface)

    def send(self, frame: Sendable, *, esi: bool = False) -> bool:
        """Send a frame; False if the bus cannot carry it. Raises `ActuationError` and `InterfaceError`."""
        if frame.fd and not self._fd:
            self.left_out["CAN FD frames"] += 1
            return False
        self._check(frame)
        self._sender.send(to_message(frame, esi=esi))
        self.sent += 1
        return True

    def _check(self, frame: Sendable) -> None:
        if self._guard is None:
            return
        verdict = self._guard.judge(frame.id, extended=frame.extended, remote=frame.remote)
        if not verdict.actuates:
            return
        since = ""
        if not self.doubt and self._clock() - self._asked >= AGAIN:
            self._ask_again()
            since = f" now ({self.doubt})"
        if self.doubt:
            raise ActuationError(
                f"{verdict.name} of node {verdict.node} comes up {frame.t / SECOND:.3f} s after the start: "
                f"not sent on {self.interface.name}, which may be real{since}, without --allow-actuation"
            )

    def _ask(self, interface: Interface) -> None:
        self._asked = self._clock()
        self.doubt = find_doubt(interface.kind, interface.channel, interface.options)

    def _ask_again(self) -> None:
        """Ask of the same interface, which may have another name: the bus stays with it."""
        self._ask(self.interface)
        if not self._index:
            return
        try:
            name = socket.if_indextoname(self._index)
        except OSError:  # it has been removed: sending will say so
            self.doubt = ""
        else:
            if name != str(self.interface.channel):
                self.doubt = f"it is called {name} by now"


def _index(interface: Interface) -> int:
    """Return the kernel's number of an interface, which stays when its name changes; 0 if it has none."""
    if interface.kind != "socketcan":
        return 0
    try:
        return socket.if_nametoindex(str(interface.channel))
    except OSError:
        return 0


def to_message(frame: Sendable, *, esi: bool = False) -> can.Message:
    """Return the frame as python-can sends it."""
    return can.Message(
        arbitration_id=frame.id,
        is_extended_id=frame.extended,
        is_remote_frame=frame.remote,
        is_fd=frame.fd,
        bitrate_switch=frame.brs,
        error_state_indicator=esi,
        dlc=frame.dlc or 0 if frame.remote else None,
        data=None if frame.remote else frame.data,
    )


def _takes_fd(bus: can.BusABC, interface: Interface) -> bool:
    """Return True if it takes CAN FD: the virtual bus always does, a SocketCAN interface says so itself."""
    link = interface.link
    return link.fd if link else interface.kind == "virtual" or bus.protocol is not can.CanProtocol.CAN_20
