"""Viewers for tests: Rerun without a window, which writes down what it is sent, and what only looks like a viewer."""

from __future__ import annotations

import socket
import subprocess
import threading
import warnings
from contextlib import contextmanager
from typing import TYPE_CHECKING

from plotted import Drawn, read_back

from analyzer.cli import plot_viewer
from analyzer.plot.address import Address

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


class Deaf:
    """Listens; reads nothing of what it is sent, or closes every connection at once."""

    def __init__(self, *, closes: bool = False) -> None:
        self._closes = closes
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.address = Address("rerun+http", "127.0.0.1", self._listening.getsockname()[1])
        self._open: list[socket.socket] = []
        self._thread = threading.Thread(target=self._accept, daemon=True)
        self._thread.start()

    def _accept(self) -> None:
        while True:
            try:
                found, _ = self._listening.accept()
            except OSError:
                return
            if self._closes:
                found.close()
            else:
                self._open.append(found)

    def close(self) -> None:
        """Also what a connection still waits for has an end then."""
        self._listening.shutdown(socket.SHUT_RDWR)
        self._thread.join()
        self._listening.close()
        for one in self._open:
            one.close()


@contextmanager
def deaf(*, closes: bool = False) -> Iterator[Address]:
    one = Deaf(closes=closes)
    try:
        yield one.address
    finally:
        one.close()


@contextmanager
def keeper(folder: Path) -> Iterator[tuple[Address, Path]]:
    """Rerun without a window, which writes what it is sent into a file."""
    program = plot_viewer.binary()
    assert program is not None
    port = plot_viewer.free_port("127.0.0.1")
    kept = folder / "kept.rrd"
    command = [program, "--bind", "127.0.0.1", "--port", str(port), "--save", str(kept)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        plot_viewer._wait_for(process, port)
        yield Address("rerun+http", "127.0.0.1", port), kept
    finally:
        process.kill()
        process.wait()


def taken(kept: Path) -> Drawn:
    """What a viewer that still runs has written so far."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the end of the file is not there yet
        try:
            return read_back(kept)
        except (RuntimeError, OSError, ValueError):
            return Drawn()
