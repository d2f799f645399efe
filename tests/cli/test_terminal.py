"""The command on a terminal: widths, colours, pagers."""

from __future__ import annotations

import fcntl
import os
import pty
import struct
import termios
from typing import TYPE_CHECKING

import pytest
from kit.command import CAPTURES, HOVER, LIMIT, SGR, Reader, commands, log, start

from analyzer.views.terminal import display_width

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture
def small(tmp_path: Path) -> Path:
    path = tmp_path / "small.log"
    path.write_bytes(log(commands(0, 10_000_000, 30_000_000)))
    return path


def on_terminal(*args: object, **env: str) -> tuple[int, str]:
    """The command with both outputs on a terminal of 80 columns: status and everything that it shows."""
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
    process = start(*args, env={"TERM": "xterm", **env}, stdin=theirs, stdout=theirs, stderr=theirs)
    os.close(theirs)
    shown = Reader(ours).rest().decode()
    status = process.wait(LIMIT)
    os.close(ours)
    return status, shown.replace("\r\n", "\n")


@pytest.mark.slow
@pytest.mark.parametrize("columns", [80, 200])
@pytest.mark.parametrize("capture", ["faults.log", "services.log", "dialects.txt"])
def test_lines_fit_the_terminal(capture: str, columns: int) -> None:
    size = {} if columns == 80 else {"COLUMNS": str(columns)}
    _, shown = on_terminal("decode", "--no-pager", "-t", "ud", CAPTURES / capture, **size)
    lines = SGR.sub("", shown.partition("\n-- ")[0]).splitlines()
    listed = [line for line in lines if not line.startswith("tailbyte: ")]
    assert len(listed) > 10
    assert max(map(display_width, listed)) <= columns
    assert "\x1b[31m" in shown or capture != "faults.log"


@pytest.mark.slow
def test_colour_on_a_terminal(small: Path) -> None:
    assert "\x1b[" in on_terminal("decode", small, "--no-pager")[1]
    for args, env in (([], {"NO_COLOR": "1"}), ([], {"TERM": "dumb"}), (["--color", "never"], {})):
        status, shown = on_terminal("decode", small, "--no-pager", *args, **env)
        assert (status, "\x1b[" in shown, "RawCommand" in shown) == (0, False, True)


@pytest.mark.slow
@pytest.mark.parametrize("pager", ["cat", "", "no-such-pager", "'", "cat -", "sed p -n"])
def test_pagers_that_show_everything(pager: str) -> None:
    status, shown = on_terminal("decode", HOVER, "--color", "never", PAGER=pager)
    assert status == 0
    assert len(shown.splitlines()) == 1111 + 2


@pytest.mark.slow
def test_pagers_that_leave_early() -> None:
    assert on_terminal("decode", HOVER, PAGER="false")[0] == 0
    status, shown = on_terminal("decode", HOVER, "--color", "never", PAGER="less", TAILBYTE_PAGER="head -1")
    assert (status, shown.splitlines()[0].split()[:2]) == (0, ["Frame", "Time"])
    assert "Traceback" not in shown
    assert shown.count("RawCommand") == 0


@pytest.mark.slow
def test_complaints_wait_for_the_pager() -> None:
    status, shown = on_terminal("decode", CAPTURES / "faults.log", PAGER="cat -")
    assert status == 3
    assert shown.splitlines()[-2].startswith("tailbyte: ")
    assert shown.splitlines()[-1].startswith("-- ")
