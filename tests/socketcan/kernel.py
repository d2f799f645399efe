"""SocketCAN without python-can: a recorder, rules of the kernel's CAN gateway, and a serial adapter.

The adapter is made of a pseudo-terminal and gives the kernel a CAN device that is not virtual. The kernel's slcan
driver sits on one end, the test on the other. Unlike vcan, the device has a bit rate and an error state, frames arrive
as received ones, and the kernel itself makes the error frames. Needs the slcan module and CAP_NET_ADMIN.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import pty
import socket
import struct
import subprocess
import threading
import tty

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


TIOCSETD, SIOCGIFNAME, N_SLCAN, N_TTY = 0x5423, 0x8910, 17, 0


class SlcanAdapter:
    def __init__(self, bit_rate: int = 1_000_000) -> None:
        self._adapter, self._host = pty.openpty()
        tty.setraw(self._host)
        fcntl.ioctl(self._host, TIOCSETD, struct.pack("i", N_SLCAN))
        name = fcntl.ioctl(self._host, SIOCGIFNAME, bytes(16))
        self.channel = name.rstrip(b"\0").decode()
        self.written = bytearray()  # what the kernel sent to the adapter: commands and frames
        # The driver waits until its commands are taken, so something must read from the start.
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        for args in (["type", "can", "bitrate", str(bit_rate)], ["up"]):
            subprocess.run(["ip", "link", "set", self.channel, *args], check=True)

    def _read(self) -> None:
        with contextlib.suppress(OSError):
            while data := os.read(self._adapter, 4096):
                self.written += data

    def frame(self, number: int, data: bytes = b"") -> None:
        """One data frame with a 29-bit identifier arrives from the bus."""
        os.write(self._adapter, b"T%08X%d%s\r" % (number, len(data), data.hex().upper().encode()))

    def errors(self, kinds: str) -> None:
        """Bus errors: a ack, b bit 0, B bit 1, c CRC, f form, s stuff, o rx overrun, O tx overrun."""
        os.write(self._adapter, b"e%d%s\r" % (len(kinds), kinds.encode()))

    def state(self, state: str, rx_errors: int = 0, tx_errors: int = 0) -> None:
        """The controller's error state changes: a active, w warning, p passive, b bus off."""
        os.write(self._adapter, b"s%s%03d%03d\r" % (state.encode(), rx_errors, tx_errors))

    def unplug(self) -> None:
        """The device goes away, as when the adapter is pulled out."""
        fcntl.ioctl(self._host, TIOCSETD, struct.pack("i", N_TTY))
        os.close(self._host)
        self._reader.join()
        os.close(self._adapter)
