"""The browser on a terminal of its own: it ends in order, and leaves nothing behind."""

from __future__ import annotations

import fcntl
import os
import re
import shutil
import signal
import struct
import subprocess
import sys
import termios
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from kit import ROOT
from kit.browsing import capture
from kit.command import LIMIT, Reader, environment

if TYPE_CHECKING:
    from collections.abc import Iterator


@contextmanager
def viewed(folder: Path, *words: str, **env: str) -> Iterator[tuple[subprocess.Popen[bytes], Reader, int]]:
    """The process, what it draws, and the descriptor that takes keys; its store is below `folder`."""
    ours, theirs = os.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
    own = environment({"PYTHONPATH": str(ROOT), "TMPDIR": str(folder), "TERM": "xterm-256color"} | env)
    command = [sys.executable, "-m", "analyzer", "view", "--no-marks", *words]
    process = subprocess.Popen(command, stdin=theirs, stdout=theirs, stderr=theirs, env=own, start_new_session=True)
    os.close(theirs)
    try:
        yield process, Reader(ours), ours
    finally:
        process.kill()
        process.wait()
        os.close(ours)


@pytest.mark.slow
@pytest.mark.parametrize("how", ["q", "SIGTERM", "SIGHUP"])
def test_nothing_is_left_behind(how: str, tmp_path: Path) -> None:
    with viewed(tmp_path, capture("hover.log")) as (process, reader, keys):
        reader.until(b"RawCommand")
        assert len(list(tmp_path.iterdir())) == 1
        if how == "q":
            os.write(keys, b"q")
        else:
            process.send_signal(getattr(signal, how))
        reader.until(b"\x1b[?1049l")
        expected = 0 if how == "q" else 128 + getattr(signal, how)
        assert process.wait(LIMIT) == expected
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_without_colours(tmp_path: Path) -> None:
    with viewed(tmp_path, capture("hover.log"), NO_COLOR="1") as (_, reader, _keys):
        shown = reader.until(b"RawCommand")
        codes = {code for found in re.findall(rb"\x1b\[([0-9;]*)m", shown) for code in found.split(b";")}
        assert codes <= {b"", b"0", b"1", b"2", b"4", b"7", b"39", b"49"}


@pytest.mark.slow
@pytest.mark.parametrize(("name", "expected"), [("esc-failure.mcap", 0), ("hover.log", 0), ("damaged.log", 3)])
def test_the_status_tells_of_damage_and_not_of_notes(name: str, expected: int, tmp_path: Path) -> None:
    damaged, store = tmp_path / "damaged.log", tmp_path / "store"
    damaged.write_bytes(Path(capture("hover.log")).read_bytes() + b"(1.0) can0 what is this\n")
    store.mkdir()
    path = str(damaged) if name == damaged.name else capture(name)
    with viewed(store, path) as (process, reader, keys):
        reader.until(b"RawCommand")
        os.write(keys, b"5")
        reader.until(b"What broke first")
        os.write(keys, b"q")
        reader.until(b"\x1b[?1049l")
        assert process.wait(LIMIT) == expected


def test_a_flight_that_is_not_there_is_wrong_usage(tmp_path: Path) -> None:
    with viewed(tmp_path, "--flight", "9", capture("hover.log")) as (process, reader, _):
        shown = reader.rest().decode()
        assert process.wait(LIMIT) == 2
        assert "\x1b[?1049h" not in shown
        assert len(shown.splitlines()) == 1


@pytest.mark.parametrize("name", ["missing.log", "folder", "README.md", "empty.log"])
def test_what_holds_nothing_is_refused_in_a_line(name: str, tmp_path: Path) -> None:
    store, path = tmp_path / "store", tmp_path / name
    for folder in (store, tmp_path / "folder"):
        folder.mkdir()
    shutil.copy(ROOT / "README.md", tmp_path)
    (tmp_path / "empty.log").touch()
    with viewed(store, str(path)) as (process, reader, _):
        shown = reader.rest().decode()
        assert process.wait(LIMIT) == 3
        assert "\x1b[?1049h" not in shown
        assert shown.startswith(f"tailbyte: {path}: ")
        assert len(shown.splitlines()) == 1
    assert list(store.iterdir()) == []
