"""The viewer of Rerun without a window, and pictures of what it shows. It needs a graphics driver; software will do."""

from __future__ import annotations

import copy
import os
import socket
import subprocess
import time
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import rerun_cli
from rerun.experimental import ViewerClient

if TYPE_CHECKING:
    from collections.abc import Iterator

BINARY = Path(rerun_cli.__file__).with_name("rerun")
SIZE = "1600x1000"
START, SETTLE = 30, 20  # seconds at most


class NoViewerError(Exception):
    """The viewer does not start here."""


class Shown:
    """A viewer and the recording in it."""

    def __init__(self, client: ViewerClient) -> None:
        self._client = client
        self._blueprint: dict[str, Any] = {}

    def open(self, recording: Path, *, bare: bool = False) -> None:
        """Shows a recording and no other one; `bare` without the menu."""
        if self._client.get_state().recordings:
            self._client.close("all")
        self._client.open(str(recording.resolve()))
        self.settle()
        self._blueprint = self._client.get_blueprint("recording").blueprint
        if bare:
            self._blueprint["/top_panel"] = {"PanelBlueprint": {"state": "Hidden"}}

    def tabs(self) -> list[tuple[str, ...]]:
        """Every tab that has no tabs inside, as the names of the tabs that it is in."""
        return [tuple(self._name(path) for path in one) for one in self._ways()]

    def show(self, tab: tuple[str, ...]) -> None:
        """Brings a tab to the front."""
        way = next(one for one in self._ways() if tuple(map(self._name, one)) == tab)
        changed = copy.deepcopy(self._blueprint)
        for parts in changed.values():
            container = parts.get("ContainerBlueprint", {})
            for path in way:
                if container.get("container_kind") == "Tabs" and path in _contents(container):
                    container["active_tab"] = path
        self._client.set_blueprint(changed, "recording")

    def picture(self) -> bytes:
        """What is to be seen now, as PNG."""
        return bytes(self._client.take_screenshot())

    def settle(self) -> bytes:
        """The picture, once it stays as it is."""
        end, before = time.monotonic() + SETTLE, b""
        while time.monotonic() < end:
            now = self.picture()
            if now == before and not self._client.get_state().loading:
                break
            before = now
        return before

    def complaints(self) -> list[str]:
        """What views report of themselves."""
        return [
            f"{view.name}: {report.severity} {report.summary} {report.details or ''}"
            for view in self._client.get_state().views
            for report in view.reports
        ]

    def _name(self, path: str) -> str:
        parts = self._blueprint["/" + path]
        about = parts.get("ContainerBlueprint") or parts["ViewBlueprint"]
        return str(about.get("display_name", ""))

    def _ways(self) -> list[list[str]]:
        root = self._blueprint["/viewport"]["ViewportBlueprint"]["root_container"]
        return self._inside(f"container/{root}")

    def _inside(self, path: str) -> list[list[str]]:
        container = self._blueprint["/" + path].get("ContainerBlueprint")
        if container is None:
            return []
        found: list[list[str]] = []
        for one in _contents(container):
            deeper = self._inside(one)
            if container["container_kind"] == "Tabs":
                found += [[one, *way] for way in deeper] or [[one]]
            else:
                found += deeper
        return found


def _contents(container: dict[str, Any]) -> list[str]:
    """A list of one is told as that one."""
    found = container.get("contents", [])
    return [found] if isinstance(found, str) else found


@contextmanager
def viewer(log: Path, size: str = SIZE) -> Iterator[Shown]:
    """A viewer of its own on a free local port; ended with the block. Raises `NoViewerError`."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    command = [BINARY, "--headless", "--hide-welcome-screen", "--window-size", size]
    command += ["--bind", "127.0.0.1", "--port", str(port)]
    with log.open("wb") as errors:
        process = subprocess.Popen(command, stdout=errors, stderr=errors, env=os.environ | {"RERUN_ANALYTICS": "0"})
    try:
        yield Shown(_connected(process, port, log))
    finally:
        process.terminate()
        process.wait()


def _connected(process: subprocess.Popen[bytes], port: int, log: Path) -> ViewerClient:
    end = time.monotonic() + START
    while time.monotonic() < end:
        if process.poll() is not None:
            break
        try:
            client = ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
            client.take_screenshot(max_size=16)
        except (RuntimeError, ConnectionError, OSError):
            time.sleep(0.1)
        else:
            return client
    raise NoViewerError(log.read_text(errors="replace")[-400:] or "no answer")
