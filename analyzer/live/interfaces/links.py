"""The kernel's network interfaces, asked over rtnetlink: which of them are CAN, of what kind, and where frames go on.

Linux only; everywhere else, and when the kernel does not answer, the functions raise `OSError`.
"""

from __future__ import annotations

import errno
import os
import socket
import struct
from typing import TYPE_CHECKING

from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Iterator

# linux/rtnetlink.h, linux/netlink.h, linux/if_link.h, linux/if_arp.h, linux/can/gw.h, linux/can/netlink.h
_GET_LINK, _GET_ROUTE = 18, 26
_REQUEST, _DUMP = 0x1, 0x300
_ERROR, _DONE = 2, 3
_IFNAME, _MTU, _LINK, _QUEUE, _LINKINFO, _STATS, _NETNS = 3, 4, 5, 13, 18, 23, 37
_KIND, _DATA, _MORE_STATS = 1, 2, 3
_BITTIMING, _STATE, _MODE, _RESTART, _ERROR_COUNTERS, _DATA_BITTIMING = 1, 4, 5, 6, 8, 9
_MODES = {0x1: "loopback", 0x2: "listen only", 0x4: "triple sampling", 0x8: "one shot", 0x10: "bus errors", 0x20: "fd"}
_STATES = ("error active", "error warning", "error passive", "bus off", "stopped", "sleeping")
_SOURCE, _DESTINATION = 9, 10
_ARPHRD_CAN, _AF_CAN = 280, 29
_UP = 0x1
_FD_MTU = 72
_TYPE_MASK = 0x3FFF
_HEADER, _ATTRIBUTE = struct.Struct("=IHHII"), struct.Struct("=HH")
_LINK_BODY, _GATEWAY_BODY = struct.Struct("=BxHiII"), struct.Struct("=BBH")
_TRAFFIC = struct.Struct("=QQ32xQQ")
_BUFFER = 1 << 17
# Seconds for an answer that the kernel gives at once.
_PATIENCE = 5.0


@dataclass(frozen=True, slots=True)
class Timing:
    """Bits per second, and the sample point in tenths of a percent of a bit, 0 if the driver does not say."""

    bit_rate: int
    sample_point: int = 0


@dataclass(frozen=True, slots=True)
class Controller:
    """The state of a CAN controller, as its driver gives it.

    `state` is error active, error warning, error passive, bus off, stopped or sleeping. `timing` is None before it was
    set, `data_timing` without CAN FD. `restart_ms` is the pause after which it leaves bus off by itself, 0 if it does
    not. `modes` are those that are on: loopback, listen only, triple sampling, one shot, bus errors, fd. `tx_errors`
    and `rx_errors` are its error counters, None if it does not tell. The last three count since it was made.
    """

    state: str = ""
    timing: Timing | None = None
    data_timing: Timing | None = None
    restart_ms: int = 0
    modes: tuple[str, ...] = ()
    tx_errors: int | None = None
    rx_errors: int | None = None
    bus_errors: int = 0
    bus_offs: int = 0
    restarts: int = 0


@dataclass(frozen=True, slots=True)
class Traffic:
    """Frames since the interface was made: received, sent, and those of both that the kernel or the driver dropped."""

    received: int
    sent: int
    receive_dropped: int
    send_dropped: int


@dataclass(frozen=True, slots=True)
class Link:
    """A CAN interface: `kind` is its driver family (`vcan`, `vxcan`, `can`), empty if the kernel names none.

    With `fd` it takes CAN FD frames. `peer` is the index of the other end of a vxcan pair; `elsewhere` says that this
    end is in another network namespace, where nobody here can look. `bit_rate` is what the controller is set to, None
    without one. `queue` is the length of the transmit queue in frames. `controller` is None if there is none (vcan).
    """

    index: int
    name: str
    kind: str = ""
    up: bool = False
    fd: bool = False
    peer: int | None = None
    elsewhere: bool = False
    bit_rate: int | None = None
    mtu: int = 0
    queue: int = 0
    controller: Controller | None = None
    traffic: Traffic | None = None


def list_links() -> list[Link]:
    """Return every CAN interface of this network namespace, by index. Raises `OSError`."""
    body = _LINK_BODY.pack(0, 0, 0, 0, 0)
    found = (_link(answer) for answer in _dump(_GET_LINK, body))
    return sorted((link for link in found if link is not None), key=lambda link: link.index)


def list_gateways() -> list[tuple[int, int]]:
    """Return the rules of the kernel's CAN gateway: (index of source, index of destination). Raises `OSError`."""
    answers = _dump(_GET_ROUTE, _GATEWAY_BODY.pack(_AF_CAN, 0, 0))
    # Without a gateway the kernel answers with the routes of other protocols.
    return [_rule(answer) for answer in answers if answer[:1] == bytes([_AF_CAN])]


def _link(answer: bytes) -> Link | None:
    _, kind, index, flags, _ = _LINK_BODY.unpack_from(answer)
    if kind != _ARPHRD_CAN:
        return None
    found = dict(_attributes(answer[_LINK_BODY.size :]))
    info = dict(_attributes(found.get(_LINKINFO, b"")))
    kind_name = _text(info.get(_KIND, b""))
    mtu = _number(found.get(_MTU, b""))
    controller = _controller(info) if kind_name == "can" else None
    return Link(
        index=index,
        name=_text(found.get(_IFNAME, b"")),
        kind=kind_name,
        up=bool(flags & _UP),
        fd=mtu >= _FD_MTU,
        peer=_number(found[_LINK]) if _LINK in found else None,
        elsewhere=_NETNS in found,
        bit_rate=controller.timing.bit_rate if controller and controller.timing else None,
        mtu=mtu,
        queue=_number(found.get(_QUEUE, b"")),
        controller=controller,
        traffic=_traffic(found.get(_STATS, b"")),
    )


def _controller(info: dict[int, bytes]) -> Controller:
    data = dict(_attributes(info.get(_DATA, b"")))
    _, modes = _numbers(data.get(_MODE, b""), 2)
    state = data.get(_STATE)
    number = len(_STATES) if state is None else _number(state)
    counters = data.get(_ERROR_COUNTERS, b"")
    tx_errors, rx_errors = struct.unpack_from("=HH", counters) if len(counters) >= 4 else (None, None)
    bus_errors, _, _, bus_offs, _, restarts = _numbers(info.get(_MORE_STATS, b""), 6)
    return Controller(
        state=_STATES[number] if number < len(_STATES) else "",
        timing=_timing(data.get(_BITTIMING, b"")),
        data_timing=_timing(data.get(_DATA_BITTIMING, b"")),
        restart_ms=_number(data.get(_RESTART, b"")),
        modes=tuple(name for bit, name in _MODES.items() if modes & bit),
        tx_errors=tx_errors,
        rx_errors=rx_errors,
        bus_errors=bus_errors,
        bus_offs=bus_offs,
        restarts=restarts,
    )


def _timing(data: bytes) -> Timing | None:
    bit_rate, sample_point = _numbers(data, 2)
    return Timing(bit_rate, sample_point) if bit_rate else None


def _traffic(data: bytes) -> Traffic | None:
    if len(data) < _TRAFFIC.size:
        return None
    received, sent, receive_dropped, send_dropped = _TRAFFIC.unpack_from(data)
    return Traffic(received, sent, receive_dropped, send_dropped)


def _rule(answer: bytes) -> tuple[int, int]:
    found = dict(_attributes(answer[_GATEWAY_BODY.size :]))
    return _number(found[_SOURCE]), _number(found[_DESTINATION])


def _dump(kind: int, body: bytes) -> Iterator[bytes]:
    """Ask one question; give the bodies of every answer."""
    family = getattr(socket, "AF_NETLINK", None)
    if family is None:
        raise OSError(errno.EAFNOSUPPORT, os.strerror(errno.EAFNOSUPPORT))
    with socket.socket(family, socket.SOCK_RAW, 0) as asked:
        asked.settimeout(_PATIENCE)
        asked.send(_HEADER.pack(_HEADER.size + len(body), kind, _REQUEST | _DUMP, 1, 0) + body)
        while True:
            data = asked.recv(_BUFFER)
            at = 0
            while at + _HEADER.size <= len(data):
                length, answer, *_ = _HEADER.unpack_from(data, at)
                if length < _HEADER.size:
                    raise OSError(errno.EPROTO, os.strerror(errno.EPROTO))
                if answer == _DONE:
                    return
                if answer == _ERROR:
                    number = -int(struct.unpack_from("=i", data, at + _HEADER.size)[0])
                    raise OSError(number, os.strerror(number))
                yield data[at + _HEADER.size : at + length]
                at += _aligned(length)


def _attributes(data: bytes) -> Iterator[tuple[int, bytes]]:
    at = 0
    while at + _ATTRIBUTE.size <= len(data):
        length, kind = _ATTRIBUTE.unpack_from(data, at)
        if length < _ATTRIBUTE.size:
            return
        yield kind & _TYPE_MASK, data[at + _ATTRIBUTE.size : at + length]
        at += _aligned(length)


def _aligned(length: int) -> int:
    return (length + 3) & ~3


def _text(data: bytes) -> str:
    return data.rstrip(b"\0").decode(errors="replace")


def _number(data: bytes) -> int:
    return _numbers(data, 1)[0]


def _numbers(data: bytes, count: int) -> tuple[int, ...]:
    """Return the first numbers of 32 bits; those that are not there are 0."""
    return struct.unpack_from(f"={count}I", data.ljust(4 * count, b"\0"))
