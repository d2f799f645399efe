"""The receiver of SocketCAN with the core's own socket, on sockets of this computer."""

from __future__ import annotations

import socket
import struct
from typing import TYPE_CHECKING, ClassVar

import pytest
from kit.waiting import text

from analyzer.live.interfaces import links, socketcan
from analyzer.live.interfaces.filters import Filters, parse_filters
from analyzer.live.interfaces.naming import Interface, InterfaceError
from analyzer.live.interfaces.receiver import open_receiver

if TYPE_CHECKING:
    from collections.abc import Iterator

CAN0 = Interface("socketcan", "can0", {"fd": False})


@pytest.fixture
def pair(monkeypatch: pytest.MonkeyPatch) -> Iterator[socket.socket]:
    """A pair of datagram sockets stands in for the kernel; the test has one end."""
    mine, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)

    class Bus:
        made: ClassVar[list[Bus]] = []
        socket = theirs
        closed = 0

        def __init__(self) -> None:
            self.made.append(self)

        def shutdown(self) -> None:
            self.closed += 1

        def fileno(self) -> int:
            return theirs.fileno()

    monkeypatch.setattr(links, "list_links", list)
    monkeypatch.setattr(socketcan, "open_bus", lambda _: Bus())
    yield mine
    assert [bus.closed for bus in Bus.made] == [1]
    mine.close()
    theirs.close()


def datagram(number: int) -> bytes:
    return struct.pack("=IB3x8s", number, 2, b"ab")


def test_the_native_receiver(pair: socket.socket) -> None:
    receiver = open_receiver(CAN0, Filters())
    pair.send(datagram(0x123))
    found = text(receiver.receive(5))
    assert [line.split(" ", 1)[1] for line in found] == ["can0 123#6162 R"]
    assert receiver.receive(0) is None
    pair.send(datagram(0x124))
    assert len(receiver.finish()) == 1
    receiver.close()


def test_what_came_before_the_filters_is_thrown_away(pair: socket.socket, monkeypatch: pytest.MonkeyPatch) -> None:
    """And nothing that comes from then on."""
    monkeypatch.setattr(Filters, "hold", staticmethod(lambda to: to.getsockopt(socket.SOL_SOCKET, socket.SO_TYPE)))
    monkeypatch.setattr(Filters, "apply", lambda _, __: pair.send(datagram(0x10)))
    for number in range(10):
        pair.send(datagram(number))
    receiver = socketcan.SocketCanReceiver(CAN0, parse_filters(["10:7FF"]))
    pair.send(datagram(0x11))
    assert [line.split()[2] for line in text(receiver.receive(5))] == ["010#6162", "011#6162"]
    receiver.close()


def test_filters_that_the_kernel_refuses(pair: socket.socket) -> None:
    assert pair
    with pytest.raises(InterfaceError, match=r"^can0: \S"):
        socketcan.SocketCanReceiver(CAN0, parse_filters(["1:1"]))  # no socket of CAN


def test_it_says_whose_time_stamps_there_are(pair: socket.socket) -> None:
    """A datagram socket has no controller behind it."""
    receiver = open_receiver(CAN0, Filters(), hardware=True)
    receiver.notes()
    assert receiver.receive(0) is None
    assert receiver.notes() == []
    pair.send(datagram(0x123))
    assert receiver.receive(5) is not None
    assert receiver.notes() == ["can0: the controller stamps no frames: times are the kernel's"]
    pair.send(datagram(0x124))
    assert receiver.receive(5) is not None
    assert receiver.notes() == []
    receiver.close()
