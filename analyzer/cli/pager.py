"""Long output on a terminal goes through the pager, as git's does."""

from __future__ import annotations

import contextlib
import os
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import subprocess
    from collections.abc import Iterator
    from typing import IO


@contextlib.contextmanager
def paged(*, wanted: bool) -> Iterator[IO[str]]:
    """Give standard output, or on a terminal, if that is wanted, the pager's input.

    A pager that is quit early ends the command quietly.
    """
    pager = None if not wanted or not sys.stdout.isatty() else _start(_command())
    if pager is None or pager.stdin is None:
        yield sys.stdout
        return
    try:
        yield pager.stdin
    finally:
        with contextlib.suppress(BrokenPipeError):
            pager.stdin.close()
        _wait(pager)


def _command() -> list[str]:
    """TAILBYTE_PAGER before PAGER before less; empty, `cat` or not a command line: no pager."""
    import shlex  # noqa: PLC0415

    text = next((os.environ[name] for name in ("TAILBYTE_PAGER", "PAGER") if name in os.environ), "less")
    try:
        command = shlex.split(text)
    except ValueError:
        return []
    return [] if command == ["cat"] else command


def _start(command: list[str]) -> subprocess.Popen[str] | None:
    if not command:
        return None
    import subprocess  # noqa: PLC0415 - without a pager nobody needs it

    sys.stdout.flush()
    environment = {**os.environ, "LESS": os.environ.get("LESS", "FRX")}
    try:
        return subprocess.Popen(  # noqa: S603 - the user's own pager
            command, stdin=subprocess.PIPE, env=environment, encoding=sys.stdout.encoding, errors=sys.stdout.errors
        )
    except OSError:
        return None


def _wait(pager: subprocess.Popen[str]) -> None:
    while True:
        try:
            pager.wait()
        except KeyboardInterrupt:
            # The pager handles Ctrl-C itself; leaving before it would garble the terminal.
            continue
        return
