"""Rerun's server for a browser, behind gates, for as long as this program runs."""

from __future__ import annotations

import ipaddress
import random
import socket
import sys
import time
from contextlib import ExitStack
from typing import TYPE_CHECKING
from urllib.parse import quote

from analyzer.plot.serving.gate import HostGate
from analyzer.plot.viewer_program import (
    END,
    LOOPBACK,
    MEMORY,
    NoViewerError,
    end,
    free_port,
    start,
    wait_for,
)

if TYPE_CHECKING:
    from collections.abc import Callable

WEB_PORT = 9090
# Seconds between two looks whether it goes on.
_SLICE = 0.2
# Ends a program when whoever started it has let go of standard input, be it that nothing is left of them.
_TENDING = f"""
import subprocess, sys, threading
program = subprocess.Popen(sys.argv[1:], stdin=subprocess.DEVNULL)
def tend():
    sys.stdin.buffer.read()
    program.terminate()
    try:
        program.wait({END - 1})
    except subprocess.TimeoutExpired:
        program.kill()
threading.Thread(target=tend, daemon=True).start()
sys.exit(program.wait())
"""


class Server:
    """Pages for a browser, and the recording for whoever connects; gone with `close`, or with this program.

    What is for this program alone, `local`, is a port that is hard to guess.

    Args:
        bind: an IP address of this computer.
        port: of the pages; None chooses one.
    """

    def __init__(self, bind: str, port: int | None) -> None:
        """Start it. Raises `NoViewerError`."""
        inner = _hidden()
        grpc, web = free_port(inner), free_port(inner)
        options = ["--serve-web", "--bind", inner, "--port", str(grpc), "--web-viewer-port", str(web), *MEMORY]
        with ExitStack() as stack:
            pages = _gate(bind, port, (inner, web))
            stack.callback(pages.close)
            viewers = _gate(bind, 0, (inner, grpc))
            stack.callback(viewers.close)
            self._process = start(options, tended_by=[sys.executable, "-I", "-c", _TENDING])
            stack.callback(end, self._process)
            wait_for(self._process, grpc, inner)
            self._stack = stack.pop_all()
        host = socket.gethostname() if ipaddress.ip_address(bind).is_unspecified else _shown(bind)
        self.local = f"rerun+http://{inner}:{grpc}/proxy"
        self.public = f"rerun+http://{host}:{viewers.port}/proxy"
        self.url = f"http://{host}:{pages.port}/?url={quote(self.public, safe='')}"

    def wait(self, ready: Callable[[], object]) -> None:
        """Call `ready`, then wait for ever. Raises `NoViewerError` if it ends by itself."""
        ready()
        while (status := self._process.poll()) is None:
            time.sleep(_SLICE)  # a signal that another thread takes does not interrupt this one
        raise NoViewerError(f"the server has ended, with status {status}")

    def close(self) -> None:
        """End it."""
        self._stack.close()


def _gate(bind: str, port: int | None, inner: tuple[str, int]) -> HostGate:
    """Open a gate at a port; None is the usual one of pages, or any."""
    try:
        if port is None:
            try:
                return HostGate(bind, WEB_PORT, inner)
            except OSError:
                return HostGate(bind, 0, inner)
        return HostGate(bind, port, inner)
    except OSError:
        where = f"{bind} port {port}" if port else bind
        raise NoViewerError(f"{where} is in use, or not of this computer: choose another with --port") from None


def _hidden() -> str:
    """Return an address of this computer that no page can guess, where there is more than one."""
    made = ".".join(["127", *(str(random.SystemRandom().randrange(1, 255)) for _ in range(3))])
    try:
        with socket.socket() as one:
            one.bind((made, 0))
    except OSError:
        return LOOPBACK
    return made


def _shown(host: str) -> str:
    return f"[{host}]" if ":" in host else host
