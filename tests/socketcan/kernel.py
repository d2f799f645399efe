"""SocketCAN without python-can: a recorder, and rules of the kernel's CAN gateway."""

from __future__ import annotations

import socket
import struct
import subprocess

_FRAME = struct.Struct("=IB3x8s")
_RCVBUFFORCE, _MEMINFO = 33, 55
_NEW_ROUTE, _REQUEST_CREATE_ACK = 24, 0x1 | 0x4 | 0x400
_SOURCE, _DESTINATION = 9, 10


class Recorder:
    """Keeps every frame of an interface from now on, as (identifier with its flags, data)."""

    def __init__(self, name: str) -> None:
        self._socket = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        self._socket.setsockopt(socket.SOL_SOCKET, _RCVBUFFORCE, 16 << 20)
        self._socket.bind((name,))

    def first(self) -> tuple[int, bytes]:
        """Waits for one."""
        return self._take()

    def all(self) -> list[tuple[int, bytes]]:
        """What has come so far."""
        self._socket.setblocking(False)
        found = []
        try:
            while True:
                found.append(self._take())
        except BlockingIOError:
            return found

    @property
    def dropped(self) -> int:
        return int(struct.unpack("=9I", self._socket.getsockopt(socket.SOL_SOCKET, _MEMINFO, 36))[8])

    def close(self) -> None:
        self._socket.close()

    def _take(self) -> tuple[int, bytes]:
        number, length, data = _FRAME.unpack(self._socket.recv(_FRAME.size))
        return number, data[:length]


def route(source: str, destination: str) -> None:
    """The kernel passes every frame of one interface on to another."""
    ends = [(_SOURCE, source), (_DESTINATION, destination)]
    body = struct.pack("=BBH", socket.AF_CAN, 1, 0)
    body += b"".join(struct.pack("=HHI", 8, kind, socket.if_nametoindex(name)) for kind, name in ends)
    with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, 0) as asked:
        asked.send(struct.pack("=IHHII", 16 + len(body), _NEW_ROUTE, _REQUEST_CREATE_ACK, 1, 0) + body)
        answer = asked.recv(4096)
    assert struct.unpack_from("=i", answer, 16)[0] == 0, answer


def ip(*args: str) -> None:
    subprocess.run(["ip", "link", *args], check=True)
