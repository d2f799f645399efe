"""The address of a viewer."""

from __future__ import annotations

import re
import socket

from dissectors.records import dataclass

PORT = 9876  # of viewers
_URL = re.compile(
    r"(?:(?P<scheme>rerun|rerun\+https?)://)?(?P<host>\[[0-9A-Fa-f:.]+\]|[\w.-]+)(?::(?P<port>\d{1,5}))?(?:/|/proxy)?"
)
_PROBE = 1.5  # seconds to be connected


@dataclass(frozen=True, slots=True)
class Address:
    """The address where a viewer listens."""

    scheme: str
    host: str
    port: int

    @classmethod
    def parse(cls, text: str) -> Address:
        """Read `rerun+http://HOST:PORT/proxy`, a part of it, or a port alone. Raises `ValueError`."""
        if text.isdecimal():
            text = f"127.0.0.1:{text}"
        match = _URL.fullmatch(text)
        port = int(match["port"] or PORT) if match else 0
        if match is None or not 0 < port < 1 << 16:
            raise ValueError(f"{text!r} is no viewer's address (rerun+http://127.0.0.1:{PORT}/proxy, HOST:PORT, PORT)")
        return cls(match["scheme"] or "rerun+http", match["host"], port)

    def __str__(self) -> str:
        """Write the whole of it."""
        return f"{self.scheme}://{self.host}:{self.port}/proxy"

    def probe(self) -> None:
        """Raise `OSError` if nothing listens there."""
        socket.create_connection((self.host.strip("[]"), self.port), _PROBE).close()
