"""The kernel's network interfaces, asked over rtnetlink: which of them are CAN, of what kind, and where frames go on.

Linux only; everywhere else, and when the kernel does not answer, the functions raise `OSError`.
"""

from __future__ import annotations

import errno
import os
import socket
import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

# linux/rtnetlink.h, linux/netlink.h, linux/if_link.h, linux/if_arp.h, linux/can/gw.h, linux/can/netlink.h
_GET_LINK, _GET_ROUTE = 18, 26
_REQUEST, _DUMP = 0x1, 0x300
_ERROR, _DONE = 2, 3
_IFNAME, _MTU, _LINK, _LINKINFO, _NETNS = 3, 4, 5, 18, 37
_KIND, _DATA = 1, 2
_BITTIMING = 1
_SOURCE, _DESTINATION = 9, 10
_ARPHRD_CAN, _AF_CAN = 280, 29
_UP = 0x1
_FD_MTU = 72
_TYPE_MASK = 0x3FFF
_HEADER, _ATTRIBUTE = struct.Struct("=IHHII"), struct.Struct("=HH")
_LINK_BODY, _GATEWAY_BODY = struct.Struct("=BxHiII"), struct.Struct("=BBH")
_BUFFER = 1 << 17
# Seconds for an answer that the kernel gives at once.
_PATIENCE = 5.0


@dataclass(frozen=True, slots=True)
class Link:
    """A CAN interface: `kind` is its driver family (`vcan`, `vxcan`, `can`), empty if the kernel names none.

    With `fd` it takes CAN FD frames. `peer` is the index of the other end of a vxcan pair; `elsewhere` says that this
    end is in another network namespace, where nobody here can look. `bit_rate` is what the controller is set to, None
    without one.
    """

    index: int
    name: str
    kind: str = ""
    up: bool = False
    fd: bool = False
    peer: int | None = None
    elsewhere: bool = False
    bit_rate: int | None = None


def links() -> list[Link]:
    """Every CAN interface of this network namespace, by index. Raises `OSError`."""
    body = _LINK_BODY.pack(0, 0, 0, 0, 0)
    found = (_link(answer) for answer in _dump(_GET_LINK, body))
    return sorted((link for link in found if link is not None), key=lambda link: link.index)


def gateways() -> list[tuple[int, int]]:
    """The rules of the kernel's CAN gateway: (index of the source, index of the destination). Raises `OSError`."""
    answers = _dump(_GET_ROUTE, _GATEWAY_BODY.pack(_AF_CAN, 0, 0))
    # Without a gateway the kernel answers with the routes of other protocols.
    return [_rule(answer) for answer in answers if answer[:1] == bytes([_AF_CAN])]


def _link(answer: bytes) -> Link | None:
    _, kind, index, flags, _ = _LINK_BODY.unpack_from(answer)
    if kind != _ARPHRD_CAN:
        return None
    found = dict(_attributes(answer[_LINK_BODY.size :]))
    info = dict(_attributes(found.get(_LINKINFO, b"")))
    timing = dict(_attributes(info.get(_DATA, b""))).get(_BITTIMING, b"")
    kind_name = _text(info.get(_KIND, b""))
    return Link(
        index=index,
        name=_text(found.get(_IFNAME, b"")),
        kind=kind_name,
        up=bool(flags & _UP),
        fd=_MTU in found and _number(found[_MTU]) >= _FD_MTU,
        peer=_number(found[_LINK]) if _LINK in found else None,
        elsewhere=_NETNS in found,
        bit_rate=(_number(timing) or None) if kind_name == "can" and len(timing) >= 4 else None,
    )


def _rule(answer: bytes) -> tuple[int, int]:
    found = dict(_attributes(answer[_GATEWAY_BODY.size :]))
    return _number(found[_SOURCE]), _number(found[_DESTINATION])


def _dump(kind: int, body: bytes) -> Iterator[bytes]:
    """The bodies of every answer to one question."""
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
    return int(struct.unpack_from("=I", data)[0])
