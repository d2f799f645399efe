"""A folder that is served by SFTP over SSH, on the loopback."""

from __future__ import annotations

import socket
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import paramiko

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


class _Session(paramiko.ServerInterface):
    """Lets everyone in who proves to own a key."""

    def check_auth_publickey(self, *_: object) -> int:
        return paramiko.AUTH_SUCCESSFUL

    def check_channel_request(self, *_: object) -> int:
        return paramiko.OPEN_SUCCEEDED


class _Folder(paramiko.SFTPServerInterface):
    """The files of `root`, to be read."""

    root: Path

    def list_folder(self, path: str) -> Any:
        return [_told(one) for one in sorted((self.root / path.strip("/")).iterdir())]

    def stat(self, path: str) -> Any:
        place = self.root / path.strip("/")
        return _told(place) if place.exists() else paramiko.SFTP_NO_SUCH_FILE

    lstat = stat

    def open(self, path: str, flags: int, *_: object) -> Any:
        place = self.root / path.strip("/")
        if not place.is_file():
            return paramiko.SFTP_NO_SUCH_FILE
        handle = paramiko.SFTPHandle(flags)
        handle.readfile = place.open("rb")
        handle.stat = lambda: _told(place)
        return handle


def _told(place: Path) -> Any:
    return paramiko.SFTPAttributes.from_stat(place.stat(), place.name)


@contextmanager
def serving_ssh(folder: Path) -> Iterator[int]:
    """Serve a folder to whoever has a key; yield the port."""
    key, served = paramiko.RSAKey.generate(2048), type("Folder", (_Folder,), {"root": folder})
    transports = []
    listener = socket.create_server(("127.0.0.1", 0))

    def accept() -> None:
        while True:
            try:
                connection, _ = listener.accept()
            except OSError:
                return
            transport = paramiko.Transport(connection)
            transport.add_server_key(key)
            transport.set_subsystem_handler("sftp", paramiko.SFTPServer, served)
            transport.start_server(server=_Session())
            transports.append(transport)

    thread = threading.Thread(target=accept, daemon=True)
    thread.start()
    yield listener.getsockname()[1]
    listener.shutdown(socket.SHUT_RDWR)
    listener.close()
    thread.join()
    for one in transports:
        one.close()
