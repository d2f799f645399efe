"""The monitor on a terminal of its own, in a process of its own: drawn, keyed, and the terminal left in order."""

from __future__ import annotations

import fcntl
import os
import re
import struct
import subprocess
import sys
import termios
from contextlib import contextmanager
from typing import TYPE_CHECKING

import pytest
from kit import ROOT, TESTS
from kit.command import LIMIT, Reader, environment

if TYPE_CHECKING:
    from collections.abc import Iterator

PROGRAM = """
import sys
from kit.monitor import Script, shown, capture
from analyzer.terminal import possible, run
feed = Script([shown(capture("hover-4.log"))])
assert possible()
run(feed)
sys.stdout.write("asked " + " ".join(feed.asked))
"""
SCREEN, BACK = b"\x1b[?1049h", b"\x1b[?1049l"
COLOUR = re.compile(rb"\x1b\[[0-9;]*3[1-7][0-9;]*m")


@contextmanager
def monitor(**env: str) -> Iterator[tuple[subprocess.Popen[bytes], Reader, int]]:
    """The process, what it draws, and the descriptor that takes keys."""
    ours, theirs = os.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
    own = environment({"PYTHONPATH": os.pathsep.join(map(str, (ROOT, TESTS)))} | env)
    process = subprocess.Popen([sys.executable, "-c", PROGRAM], stdin=theirs, stdout=theirs, stderr=theirs, env=own)
    os.close(theirs)
    try:
        yield process, Reader(ours), ours
    finally:
        process.kill()
        process.wait()
        os.close(ours)


@pytest.mark.slow
@pytest.mark.parametrize("term", ["xterm-256color", "linux", "screen"])
def test_it_is_drawn_keyed_and_left_in_order(term: str) -> None:
    with monitor(TERM=term) as (process, reader, keys):
        reader.until(b"org.example")
        os.write(keys, b"m")
        reader.until(b"mark 1")
        os.write(keys, b"q")
        got = reader.until(b"asked mark stop")
        assert process.wait(LIMIT) == 0
    assert got.index(SCREEN) < got.index(b"org.example") < got.index(BACK)
    assert b"\x1b[?1000h" not in got  # the mouse stays with the terminal
    assert COLOUR.search(got)
    assert not re.search(rb"[34]8;[25];", got)  # none but the sixteen colours


@pytest.mark.slow
def test_without_colours_it_is_drawn_all_the_same() -> None:
    with monitor(TERM="xterm", NO_COLOR="1") as (process, reader, keys):
        reader.until(b"org.example")
        os.write(keys, b"\x03")
        got = reader.until(b"asked stop")
        assert process.wait(LIMIT) == 0
    assert not COLOUR.search(got)


def test_it_is_possible_on_a_terminal_only() -> None:
    code = "from analyzer.terminal import possible; raise SystemExit(possible())"
    done = subprocess.run(
        [sys.executable, "-c", code], stdin=subprocess.PIPE, env=environment(), timeout=LIMIT, check=False
    )
    assert done.returncode == 0
