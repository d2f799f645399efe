"""Long output on a terminal goes through the pager, as git's does."""

from __future__ import annotations

import contextlib
import os
import shlex
import subprocess
import sys
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterator


@contextlib.contextmanager
def paged(args: argparse.Namespace) -> Iterator[TextIO]:
    """Standard output, or on a terminal the pager's input. A pager that is quit early ends the command quietly."""
    command = shlex.split(os.environ.get("TAILBYTE_PAGER") or os.environ.get("PAGER") or "less")
    if args.no_pager or getattr(args, "follow", False) or not sys.stdout.isatty() or not command or command == ["cat"]:
        yield sys.stdout
        return
    sys.stdout.flush()
    environment = {**os.environ, "LESS": os.environ.get("LESS", "FRX")}
    try:
        pager = subprocess.Popen(command, stdin=subprocess.PIPE, text=True, encoding="utf-8", env=environment)  # noqa: S603 - the user's own pager
    except OSError:
        yield sys.stdout
        return
    assert pager.stdin is not None  # noqa: S101 - asked for above
    try:
        yield pager.stdin
    finally:
        with contextlib.suppress(BrokenPipeError):
            pager.stdin.close()
        _wait(pager)


def _wait(pager: subprocess.Popen[str]) -> None:
    while True:
        try:
            pager.wait()
        except KeyboardInterrupt:
            # The pager handles Ctrl-C itself; leaving before it would garble the terminal.
            continue
        return
