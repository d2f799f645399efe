"""From a SocketCAN interface to rows: sockets that fail in all the ways of the kernel."""

from __future__ import annotations

import errno
import os
import struct
from collections import deque
from typing import TYPE_CHECKING
from unittest.mock import Mock

import pytest
from kit.command import START
from kit.waiting import SECOND, Clock, everything, text

from analyzer._native import Rows
from analyzer.live import remarks
from analyzer.live.interfaces import journal as watching
from analyzer.live.interfaces import links, socketcan
from analyzer.live.interfaces.filters import Filters, parse_filters
from analyzer.live.interfaces.naming import Interface, InterfaceError

if TYPE_CHECKING:
    from analyzer._native import FrameBatch

CAN0 = Interface("socketcan", "can0", {"fd": False})
DOWN, GONE, ODD = (OSError(number, os.strerror(number)) for number in (errno.ENETDOWN, errno.ENODEV, errno.EIO))


def frames(*numbers: int) -> FrameBatch:
    rows = Rows()
    for number in numbers:
        rows.frame(START + number * SECOND, "can0", number, 0, b"")
    return rows.take()


class SocketReceiver:
    """The native receiver of a script: rows, errors, or nothing."""

    script: deque[FrameBatch | OSError | None]
    made = 0
    dropped = lost = 0

    def __init__(self, fd: int, bus: str, *, buffer: int, hardware: bool) -> None:
        assert (fd, bus, buffer, hardware) == (7, "can0", socketcan.BUFFER, False)
        type(self).made += 1
        self.buffer, self._got = 2 * buffer, None
        self.woken = 0

    def receive(self, timeout_ms: int) -> int:
        assert timeout_ms >= 0
        got = self.script.popleft() if self.script else None
        if isinstance(got, OSError):
            raise got
        self._got = got
        return self.waiting

    def finish(self) -> int:
        """The rest that never was asked for."""
        if isinstance(self.script and self.script[0], OSError) or not self.script:
            return 0
        self._got = self.script.popleft()  # type: ignore[assignment]
        return self.waiting

    def drops_now(self) -> int:
        return self.lost

    @property
    def waiting(self) -> int:
        return self._got.lines["lines"] if self._got is not None else 0

    def take(self) -> FrameBatch | None:
        got, self._got = self._got, None
        return got

    def wake(self) -> None:
        self.woken += 1


class Opened:
    """What python-can gives."""

    closed = 0

    def fileno(self) -> int:
        return 7

    def shutdown(self) -> None:
        self.closed += 1


class Kernel:
    """One interface, and how it was opened."""

    def __init__(self) -> None:
        self.link: links.Link | None = links.Link(3, "can0", "can", up=True)
        self.buses: list[Opened] = []
        self.refuses = 0

    def links(self) -> list[links.Link]:
        return [self.link] if self.link is not None else []

    def name_of(self, index: int) -> str:
        if self.link is None or self.link.index != index:
            raise OSError(errno.ENXIO, "no interface with this index")
        return self.link.name

    def open(self, interface: Interface) -> Opened:
        assert interface.options["fd"] is True
        if self.refuses:
            self.refuses -= 1
            raise InterfaceError("can0", "not yet")
        self.buses.append(Opened())
        return self.buses[-1]


@pytest.fixture
def kernel(monkeypatch: pytest.MonkeyPatch) -> Kernel:
    made = Kernel()
    monkeypatch.setattr(links, "list_links", made.links)
    monkeypatch.setattr("socket.if_indextoname", made.name_of)
    monkeypatch.setattr(socketcan, "open_bus", made.open)
    monkeypatch.setattr(socketcan, "SocketReceiver", SocketReceiver)
    SocketReceiver.script, SocketReceiver.made = deque(), 0
    return made


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    made = Clock()
    monkeypatch.setattr("time.sleep", made.sleep)
    return made


def opened(clock: Clock, *script: FrameBatch | OSError | None) -> socketcan.SocketCanReceiver:
    SocketReceiver.script.extend(script)
    return socketcan.SocketCanReceiver(CAN0, Filters(), clock.ns, clock.now)


def test_rows_as_the_native_receiver_has_them(kernel: Kernel, clock: Clock) -> None:
    receiver = opened(clock, frames(1, 2), None, frames(3))
    assert text(receiver.receive(0.1)) == ["(01.000000) can0 001#", "(02.000000) can0 002#"]
    assert receiver.receive(0.1) is None
    assert [text(piece) for piece in receiver.finish()] == [["(03.000000) can0 003#"]]
    assert receiver.notes() == ["can0: receive buffer of 8,388,608 bytes, 10,922 classic frames"]
    assert receiver.notes() == []
    receiver.close()
    receiver.close()
    assert kernel.buses[0].closed == 1
    assert receiver.failed is None


def test_losses_that_no_frame_tells(kernel: Kernel, clock: Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    """They are told as soon as the bus is silent, and not only by the next frame."""
    assert kernel
    receiver = opened(clock, frames(1), None, remarks.make_drop(START + 2 * SECOND, 5, "can0"))
    assert len(everything(receiver, clock, 0.01)) == 1
    monkeypatch.setattr(SocketReceiver, "lost", 5)
    assert everything(receiver, clock, 0.01) == ["DROPCOUNT: dropped 5 CAN frames on 'can0' socket (total drops 5)"]
    monkeypatch.setattr(SocketReceiver, "dropped", 5)
    SocketReceiver.script.extend([None, frames(3)])
    assert receiver.receive(0.1) is None  # nothing more is asked for


def test_a_buffer_that_is_not_granted(kernel: Kernel, clock: Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    assert kernel
    monkeypatch.setattr(SocketReceiver, "waiting", 0)

    def small(self: SocketReceiver, *_: object, **__: object) -> None:
        self.buffer = 425_984

    monkeypatch.setattr(SocketReceiver, "__init__", small)
    (note,) = opened(clock).notes()
    assert note == (
        "can0: receive buffer of 425,984 bytes, 554 classic frames, less than asked for: that takes CAP_NET_ADMIN or "
        "net.core.rmem_max"
    )


def test_down_and_up_again(kernel: Kernel, clock: Clock) -> None:
    """The error comes behind what was queued; the link is looked at, and the same socket goes on."""
    receiver = opened(clock, frames(1), DOWN)
    kernel.link = links.Link(3, "can0", "can", up=False)
    assert everything(receiver, clock, 3) == ["(01.000000) can0 001#", "# can0: link down"]
    kernel.link = links.Link(3, "can0", "can", up=True)
    assert everything(receiver, clock) == ["# can0: link up after 3.0 s"]
    SocketReceiver.script.append(frames(9))
    assert everything(receiver, clock) == ["(09.000000) can0 009#"]
    assert receiver.notes()[1:] == ["can0: link down", "can0: link up after 3.0 s"]
    assert SocketReceiver.made == 1


def test_a_short_gap_is_told_in_front_of_what_comes_after_it(kernel: Kernel, clock: Clock) -> None:
    receiver = opened(clock, DOWN, frames(5))
    kernel.link = None  # nobody can be asked
    assert everything(receiver, clock)[1:] == ["# can0: link up after 0.0 s", "(05.000000) can0 005#"]


def test_losses_do_not_say_that_a_link_is_up(kernel: Kernel, clock: Clock) -> None:
    kernel.link = links.Link(3, "can0", "can", up=False)
    receiver = opened(clock, remarks.make_drop(START, 5, "can0"))
    assert [line.split(":")[0] for line in everything(receiver, clock)] == ["# can0", "DROPCOUNT"]


def test_the_time_of_a_link_that_is_up_again(kernel: Kernel, clock: Clock) -> None:
    kernel.link = links.Link(3, "can0", "can", up=False)
    receiver = opened(clock, frames(5))
    piece = receiver.receive(0.1)
    assert text(piece) == ["# can0: is down, waiting (ip link set can0 up)"]
    piece = receiver.receive(0.1)
    assert piece is not None
    assert struct.unpack("=q", piece.columns()[1]["t"]) == (START + 5 * SECOND,)
    assert "link up" in text(piece)[0]


def test_removed_and_back_with_another_number(kernel: Kernel, clock: Clock) -> None:
    receiver = opened(clock, frames(1), GONE, frames(2))  # the last is found at the end of the old socket
    kernel.link = None
    assert everything(receiver, clock, 10) == [
        "(01.000000) can0 001#", "(02.000000) can0 002#", "# can0: removed, waiting for it to come back",
    ]  # fmt: skip
    assert kernel.buses[0].closed
    assert receiver.finish() == []
    receiver.wake()
    kernel.link, kernel.refuses = links.Link(9, "can0", "can", up=False), 2
    assert everything(receiver, clock, 5) == ["# can0: back after 10.6 s, still down"]
    assert SocketReceiver.made == 2
    kernel.link = links.Link(9, "can0", "can", up=True)
    assert everything(receiver, clock)[0].startswith("# can0: link up after 4.")
    SocketReceiver.script = deque([frames(7)])
    assert everything(receiver, clock) == ["(07.000000) can0 007#"]
    assert [note.split(" ", 1)[1][:7] for note in receiver.notes()] == ["receive", "removed", "back af", "link up"]


def test_an_interface_of_the_same_number_that_is_another_one(kernel: Kernel, clock: Clock) -> None:
    """After it was renamed the socket goes on, and its number says whether it is up."""
    receiver = opened(clock, DOWN)
    kernel.link = links.Link(3, "renamed", "can", up=True)
    assert everything(receiver, clock) == ["# can0: link down", "# can0: link up after 0.2 s"]


def test_a_renamed_interface_is_told_once(kernel: Kernel, clock: Clock) -> None:
    receiver = opened(clock, frames(1))
    everything(receiver, clock)
    kernel.link = links.Link(3, "renamed", "can", up=True)
    assert everything(receiver, clock, 20) == ["# can0: is called renamed now"]
    assert everything(receiver, clock, 20) == []
    kernel.link = None
    assert everything(receiver, clock, 20) == []


def test_errors_that_nobody_foresaw(kernel: Kernel, clock: Clock) -> None:
    """It is opened anew, after growing pauses, and given up in the end."""
    receiver = opened(clock, *[ODD] * 1000)
    found: list[str] = []
    while receiver.failed is None:
        found += everything(receiver, clock)
    assert receiver.failed == "Input/output error, again and again"
    assert found[0] == "# can0: Input/output error; opening it again"
    assert found[1].startswith("# can0: back after 0.")
    assert found[-1] == "# can0: Input/output error, again and again"
    assert watching.LIMIT <= clock.seconds < watching.LIMIT + 10
    assert len(found) < 60
    assert receiver.receive(0.1) is None
    assert all(bus.closed for bus in kernel.buses)


def test_one_odd_error_is_repaired(kernel: Kernel, clock: Clock) -> None:
    receiver = opened(clock, ODD)
    everything(receiver, clock)
    SocketReceiver.script.append(frames(4))
    assert everything(receiver, clock) == ["(04.000000) can0 004#"]
    assert (len(kernel.buses), receiver.failed) == (2, None)


def test_filters_of_an_interface_that_is_down(kernel: Kernel, clock: Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    """The kernel tells each socket once: it is waited for as without filters."""
    asked = Mock(recv=Mock(side_effect=[DOWN, BlockingIOError(errno.EAGAIN, ""), ODD]))
    monkeypatch.setattr(Opened, "socket", asked, raising=False)
    kernel.link = links.Link(3, "can0", "can", up=False)
    receiver = socketcan.SocketCanReceiver(CAN0, parse_filters(["10:7FF"]), clock.ns, clock.now)
    assert asked.recv.call_count == 2
    assert text(receiver.receive(0)) == ["# can0: is down, waiting (ip link set can0 up)"]
    with pytest.raises(InterfaceError, match=r"^can0: Input/output error$"):
        socketcan.SocketCanReceiver(CAN0, parse_filters(["10:7FF"]), clock.ns, clock.now)
    assert kernel.buses[-1].closed
