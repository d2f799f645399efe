"""A gate in front of a server that asks nobody who they are: pages of other hosts must not read what it has.

A browser takes whatever address a name leads to for the host of that name: a page that anybody has made may give its
own name an address of this computer, and read what is served there. The name then stands in the `Host` header, so only
names that no one else can give are let through.
"""

from __future__ import annotations

import ipaddress
import socket
from contextlib import ExitStack, suppress
from threading import Thread

# Native viewers begin like this; browsers speak HTTP/2 only where it is encrypted.
_HTTP_2 = b"PRI * HTTP/2.0\r\n"
_END = b"\r\n\r\n"
_LONGEST = 1 << 16  # bytes of a head
_PATIENCE = 20.0  # seconds until a head is there
_PIECE = 1 << 16
_REFUSED = (
    b"HTTP/1.1 403 Forbidden\r\nContent-Type: text/plain\r\nContent-Length: 26\r\nConnection: close\r\n\r\n"
    b"this is not that computer\n"
)


class HostGate:
    """Listens on an address and passes on to another one what may come in. It ends with `close`.

    Args:
        bind: an IP address of this computer.
        port: where it listens, 0 for any that is free.
        inner: host and port of the server.

    Raises `OSError` if it cannot listen there.
    """

    def __init__(self, bind: str, port: int, inner: tuple[str, int]) -> None:
        family = socket.AF_INET6 if ":" in bind else socket.AF_INET
        both = bind == "::" and socket.has_dualstack_ipv6()
        self._listening = socket.create_server((bind, port), family=family, dualstack_ipv6=both)
        self.port = int(self._listening.getsockname()[1])
        self._inner = inner
        Thread(target=self._accept, name="gate", daemon=True).start()

    def close(self) -> None:
        """Let nobody in any more."""
        with suppress(OSError):
            self._listening.shutdown(socket.SHUT_RDWR)  # else `accept` would go on waiting
        self._listening.close()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                came, _ = self._listening.accept()
                Thread(target=self._serve, args=(came,), name="gate", daemon=True).start()

    def _serve(self, came: socket.socket) -> None:
        with ExitStack() as stack, suppress(OSError):
            stack.enter_context(came)
            came.settimeout(_PATIENCE)
            head = _head(came)
            if head is None:
                came.sendall(_REFUSED)
                return
            came.settimeout(None)
            inner = stack.enter_context(socket.create_connection(self._inner))
            inner.sendall(head)
            back = Thread(target=_pass_on, args=(inner, came), name="gate", daemon=True)
            back.start()
            _pass_on(came, inner)
            back.join()


def is_ours(host: str) -> bool:
    """Return True if nobody else can give that name: an IP address, `localhost`, or what this computer is called.

    A port behind it makes no difference.
    """
    name = host.strip().lower()
    if name.startswith("["):
        name = name[1:].partition("]")[0]
    elif name.count(":") == 1:
        name = name.partition(":")[0]
    with suppress(ValueError):
        ipaddress.ip_address(name)
        return True
    return name in {"localhost", socket.gethostname().lower()}


def _head(came: socket.socket) -> bytes | None:
    """Return the head of the first request, with what came behind it; None if it must not pass.

    A browser sends what is for another host on another connection: those that follow need no look.
    """
    data = b""
    while _END not in data and not data.startswith(_HTTP_2):
        more = came.recv(_PIECE)
        data += more
        if not more or len(data) > _LONGEST:
            return None
    if data.startswith(_HTTP_2):
        return data
    lines = data.partition(_END)[0].split(b"\r\n")[1:]
    names = (line.partition(b":") for line in lines)
    hosts = [value.decode("latin-1") for name, _, value in names if name.strip().lower() == b"host"]
    return data if len(hosts) == 1 and is_ours(hosts[0]) else None


def _pass_on(source: socket.socket, target: socket.socket) -> None:
    with suppress(OSError):
        while data := source.recv(_PIECE):
            target.sendall(data)
    with suppress(OSError):
        target.shutdown(socket.SHUT_WR)
