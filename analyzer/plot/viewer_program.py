"""Rerun's viewer as a program of its own: a window that stays when we leave, or pages for a browser until Ctrl-C."""

from __future__ import annotations

import ipaddress
import os
import shutil
import socket
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import quote

from analyzer.plot import LOG_LEVEL

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

LOOPBACK = "127.0.0.1"
WEB_PORT = 9090
_START = 20.0  # seconds until it listens
_END = 5.0
_PAUSE = 0.05
# Of the computer's; a viewer that has more than this leaves the oldest away.
_MEMORY = ("--server-memory-limit", "50%")


class NoViewerError(Exception):
    """There is no viewer, for this reason."""


def binary() -> str | None:
    """Find the program, not the script in front of it: who ends that one leaves the viewer running."""
    from importlib.util import find_spec  # noqa: PLC0415 - only this needs it

    if (given := os.environ.get("RERUN_CLI_PATH")) is not None:
        return given if Path(given).is_file() else None
    spec = find_spec("rerun_cli")
    folders = [Path(folder) for folder in (spec.submodule_search_locations or ())] if spec else []
    names = ("Rerun.app/Contents/MacOS/Rerun", "rerun", "rerun.exe")
    found = (str(folder / name) for folder in folders for name in names if (folder / name).is_file())
    return next(found, None) or shutil.which("rerun")


def display() -> bool:
    """Return whether windows can be opened."""
    return sys.platform in {"darwin", "win32"} or any(map(os.environ.get, ("WAYLAND_DISPLAY", "DISPLAY")))


def window() -> int:
    """Open a window that outlives this program; return the port on which it waits. Raises `NoViewerError`."""
    port = free_port(LOOPBACK)
    process = _start(["--bind", LOOPBACK, "--port", str(port), *_MEMORY, "--hide-welcome-screen", "--expect-data-soon"])
    _wait_for(process, port)
    return port


class Server:
    """Pages for a browser, and the recording for whoever connects; gone with `close`.

    Args:
        bind: an address of this computer.
        port: of the pages; None chooses one.
    """

    def __init__(self, bind: str, port: int | None) -> None:
        """Start it. Raises `NoViewerError`."""
        web = port or (WEB_PORT if _is_free(bind, WEB_PORT) else free_port(bind))
        if not _is_free(bind, web):
            raise NoViewerError(f"{bind} port {web} is in use, or not of this computer: choose another with --port")
        self.port = free_port(bind)
        options = ["--serve-web", "--bind", bind, "--port", str(self.port), "--web-viewer-port", str(web), *_MEMORY]
        self._process = _start(options)
        self.host = _reached(bind)
        try:
            _wait_for(self._process, self.port, self.host)
        except BaseException:
            self.close()
            raise
        self.local = f"rerun+http://{_shown(self.host)}:{self.port}/proxy"
        host = socket.gethostname() if ipaddress.ip_address(bind).is_unspecified else _shown(bind)
        proxy = quote(f"rerun+http://{host}:{self.port}/proxy", safe="")
        self.url = f"http://{host}:{web}/?url={proxy}"

    def wait(self, ready: Callable[[], object]) -> None:
        """Call `ready`, then wait for ever. Raises `NoViewerError` if it ends by itself."""
        ready()
        status = self._process.wait()
        raise NoViewerError(f"the server has ended, with status {status}")

    def close(self) -> None:
        """End it."""
        self._process.terminate()
        try:
            self._process.wait(_END)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


def free_port(host: str) -> int:
    """One that nobody listens on now. Raises `NoViewerError` for an address that is not ours."""
    try:
        with socket.socket(_family(host)) as found:
            found.bind((host, 0))
            return int(found.getsockname()[1])
    except OSError as error:
        raise NoViewerError(f"{host}: {error.strerror or error}") from None


def address(text: str) -> str:
    """Read an IP address to listen on. Raises `ValueError`."""
    try:
        return str(ipaddress.ip_address(text))
    except ValueError:
        raise ValueError(f"{text!r} is no IP address (127.0.0.1, 0.0.0.0 for all of this computer)") from None


def _family(host: str) -> socket.AddressFamily:
    return socket.AF_INET6 if ":" in host else socket.AF_INET


def _reached(bind: str) -> str:
    """Where what is bound there is found from here."""
    if not ipaddress.ip_address(bind).is_unspecified:
        return bind
    return "::1" if ":" in bind else LOOPBACK


def _shown(host: str) -> str:
    return f"[{host}]" if ":" in host else host


def _is_free(host: str, port: int) -> bool:
    try:
        with socket.socket(_family(host)) as one:
            one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            one.bind((host, port))
    except OSError:
        return False
    return True


def _start(options: Sequence[str]) -> subprocess.Popen[bytes]:
    """In a session of its own, so that neither Ctrl-C nor the end of the terminal reaches it."""
    program = binary()
    if program is None:
        raise NoViewerError("there is no viewer: pip install rerun-sdk")
    usual = {name: value for name, value in os.environ.items() if name != LOG_LEVEL}
    nothing = subprocess.DEVNULL
    try:
        return subprocess.Popen(  # noqa: S603 - Rerun's own program, or what the user says is
            [program, *options], stdin=nothing, stdout=nothing, stderr=nothing, env=usual, start_new_session=True
        )
    except OSError as error:
        raise NoViewerError(f"{program}: {error.strerror or error}") from None


def _wait_for(process: subprocess.Popen[bytes], port: int, host: str = LOOPBACK) -> None:
    end = time.monotonic() + _START
    while time.monotonic() < end:
        if process.poll() is not None:
            raise NoViewerError(f"the viewer does not start (exit status {process.returncode})")
        with suppress(OSError):
            socket.create_connection((host, port), _START).close()
            return
        time.sleep(_PAUSE)
    process.kill()
    process.wait()
    raise NoViewerError(f"the viewer does not listen within {_START:g} s")
