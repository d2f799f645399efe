"""Runs the command as a shell does: a process of its own, streams as given, time limits instead of luck."""

from __future__ import annotations

import os
import re
import resource
import selectors
import subprocess
import sys
import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kit import CAPTURES, ROOT, TESTS, encode

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

HOVER = CAPTURES / "hover.log"
BESIDE = Path(sys.executable).with_name("tailbyte")
CODE = "import sys; from analyzer.cli import main; sys.exit(main())"
LAUNCH = [str(BESIDE)] if BESIDE.exists() else [sys.executable, "-c", CODE]
LIMIT = 1800  # seconds; a machine that is slow or busy does not reach it, only what hangs does
START = 1_773_475_330_000_000_000  # 2026-03-14 08:02:10 UTC
SGR = re.compile(r"\x1b\[[0-9;]*m")


def environment(more: Mapping[str, str] | None = None) -> dict[str, str]:
    """The caller's, without what would colour, page, buffer or translate the output."""
    unwanted = ("NO_COLOR", "PAGER", "TAILBYTE_PAGER", "COLUMNS", "PYTHONIOENCODING", "PYTHONUNBUFFERED", "LESS")
    kept = {name: value for name, value in os.environ.items() if name not in unwanted}
    return kept | {"PYTHONPATH": str(ROOT), "TZ": "UTC"} | dict(more or {})


def start(*args: object, env: Mapping[str, str] | None = None, **more: Any) -> subprocess.Popen[bytes]:
    return subprocess.Popen([*LAUNCH, *map(os.fsencode, map(_text, args))], env=environment(env), **more)


def run(*args: object, env: Mapping[str, str] | None = None, **more: Any) -> subprocess.CompletedProcess[bytes]:
    """Both streams captured unless told otherwise."""
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | more
    command = [*LAUNCH, *map(os.fsencode, map(_text, args))]
    return subprocess.run(command, env=environment(env), timeout=LIMIT, check=False, **streams)


def run_in_room(size: int, *args: object) -> subprocess.CompletedProcess[bytes]:
    """With no room for a file of more than `size` bytes; nor is bytecode written, half of which others would load."""
    limit = partial(resource.setrlimit, resource.RLIMIT_FSIZE, (size, size))
    return run(*args, env={"PYTHONDONTWRITEBYTECODE": "1"}, preexec_fn=limit)


def _text(arg: object) -> str | bytes:
    return arg if isinstance(arg, str | bytes) else str(arg)


def wait_until(true: Callable[[], bool]) -> None:
    """Looks again and again, for as long as `LIMIT`."""
    end = time.monotonic() + LIMIT
    while not true():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.01)


class Reader:
    """Takes what a process writes to a descriptor, as far as it is waited for."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor, self.got = descriptor, b""
        self._selector = selectors.DefaultSelector()
        self._selector.register(descriptor, selectors.EVENT_READ)

    def until(self, text: bytes) -> bytes:
        """Everything so far, once `text` is in it."""
        end = time.monotonic() + LIMIT
        while text not in self.got:
            assert self._selector.select(max(0.0, end - time.monotonic())), f"no {text!r} in {self.got!r}"
            more = self._read()
            assert more, f"ended without {text!r}: {self.got!r}"
            self.got += more
        return self.got

    def _read(self) -> bytes:
        try:
            return os.read(self._descriptor, 65536)
        except OSError:  # how a terminal says that nobody writes any more
            return b""

    def rest(self) -> bytes:
        """Everything up to the end."""
        while self._selector.select(LIMIT):
            if not (more := self._read()):
                break
            self.got += more
        self._selector.close()
        return self.got


def commands(*times: int, bus: str = "can0", first: int = 0) -> list[encode.Frame]:
    """One RawCommand in one frame at each time (ns after `START`), sent by node 1."""
    sent = [(t, encode.transfer("RawCommand", {"cmd": [k, 0]}, 1, k)) for k, t in enumerate(times, first)]
    return [frame for t, one in sent for frame in one.frames(START + t, bus=bus)]


def log(frames: list[encode.Frame]) -> bytes:
    return "".join(encode.log_line(frame, 9) + "\n" for frame in frames).encode()


BUS = "virtual:here"


def start_with_bus(*args: object, env: Mapping[str, str] | None = None, **more: Any) -> subprocess.Popen[bytes]:
    """`args` are those of the program `bus_process`."""
    path = os.pathsep.join(map(str, (ROOT, TESTS)))
    own = environment({"PYTHONPATH": path, "CAN_CONFIG": "{}"} | dict(env or {}))
    return subprocess.Popen([sys.executable, TESTS / "kit" / "bus_process.py", *map(str, args)], env=own, **more)
