"""Rerun's viewer as a program of its own: how it is found and started, and a window that stays when we leave."""

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

from analyzer.plot import LOG_LEVEL

if TYPE_CHECKING:
    from collections.abc import Sequence

LOOPBACK = "127.0.0.1"
_START = 20.0  # seconds until it listens
END = 5.0  # and until it has ended
_PAUSE = 0.05
# Of the computer's; a viewer that has more than this leaves the oldest away.
MEMORY = ("--server-memory-limit", "50%")


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
    process = start(["--bind", LOOPBACK, "--port", str(port), *MEMORY, "--hide-welcome-screen", "--expect-data-soon"])
    wait_for(process, port)
    return port


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


def start(options: Sequence[str], tended_by: Sequence[str] = ()) -> subprocess.Popen[bytes]:
    """Start it in a session of its own, so that neither Ctrl-C nor the end of the terminal reaches it.

    `tended_by` runs it, and has a pipe from this program. Raises `NoViewerError`.
    """
    program = binary()
    if program is None:
        raise NoViewerError("there is no viewer: pip install rerun-sdk")
    usual = {name: value for name, value in os.environ.items() if name != LOG_LEVEL}
    nothing = subprocess.DEVNULL
    try:
        return subprocess.Popen(  # noqa: S603 - Rerun's own program, or what the user says is
            [*tended_by, program, *options], stdin=subprocess.PIPE if tended_by else nothing, stdout=nothing,
            stderr=nothing, env=usual, start_new_session=True,
        )  # fmt: skip
    except OSError as error:
        raise NoViewerError(f"{program}: {error.strerror or error}") from None


def end(process: subprocess.Popen[bytes]) -> None:
    """End it, or have it ended by what tends it."""
    if process.stdin is not None:
        process.stdin.close()
    else:
        process.terminate()
    try:
        process.wait(END)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def wait_for(process: subprocess.Popen[bytes], port: int, host: str = LOOPBACK) -> None:
    """Wait until it listens. Raises `NoViewerError` if it does not."""
    until = time.monotonic() + _START
    while time.monotonic() < until:
        if process.poll() is not None:
            raise NoViewerError(f"the viewer does not start (exit status {process.returncode})")
        with suppress(OSError):
            socket.create_connection((host, port), _START).close()
            return
        time.sleep(_PAUSE)
    end(process)
    raise NoViewerError(f"the viewer does not listen within {_START:g} s")
