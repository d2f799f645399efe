"""A live session on a terminal: the monitor while it runs, the verdict behind it, and every way to end it."""

from __future__ import annotations

import fcntl
import os
import re
import signal
import struct
import termios
from contextlib import contextmanager
from typing import TYPE_CHECKING

import pytest
from kit.command import BUS, CAPTURES, LIMIT, Reader, run, start_with_bus, wait_until

if TYPE_CHECKING:
    import subprocess
    from collections.abc import Callable, Iterator
    from io import FileIO
    from pathlib import Path

FAULTY = CAPTURES / "mission-8-faults.log"
HOVER = CAPTURES / "hover-4.log"
SCREEN, BACK = b"\x1b[?1049h", b"\x1b[?1049l"


def size(terminal: int, lines: int, columns: int) -> None:
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", lines, columns, 0, 0))


class Seen:
    """A session on a terminal of its own; `reader` has what is drawn."""

    def __init__(self, process: subprocess.Popen[bytes], terminal: FileIO) -> None:
        self.process, self.terminal, self.reader = process, terminal, Reader(terminal.fileno())

    def press(self, key: bytes) -> None:
        self.terminal.write(key)

    def ended(self) -> tuple[int, str]:
        """The exit status, and everything behind the monitor."""
        got = self.reader.rest()
        assert b"Traceback" not in got
        return self.process.wait(LIMIT), got.rpartition(BACK)[2].decode()


def _own_terminal() -> None:
    fcntl.ioctl(0, termios.TIOCSCTTY, 0)


@contextmanager
def watched(*args: object, flies: object = FAULTY, **env: str) -> Iterator[Seen]:
    """A session that was started on a terminal."""
    ours, theirs = os.openpty()
    size(theirs, 24, 80)
    process = start_with_bus(
        flies, "live", BUS, *args, env={"TERM": "xterm"} | env, stdin=theirs, stdout=theirs, stderr=theirs,
        start_new_session=True, preexec_fn=_own_terminal,
    )  # fmt: skip
    os.close(theirs)
    try:
        with open(ours, "r+b", buffering=0) as terminal:  # noqa: PTH123 - a descriptor
            yield Seen(process, terminal)
    finally:
        process.kill()
        process.wait()


def key(letter: bytes) -> Callable[[Seen], None]:
    return lambda seen: seen.press(letter)


def sent(number: int) -> Callable[[Seen], None]:
    return lambda seen: seen.process.send_signal(number)


@pytest.mark.slow
@pytest.mark.parametrize("end", [key(b"q"), key(b"\x03"), sent(signal.SIGTERM), sent(signal.SIGINT)])
def test_every_end_leaves_the_terminal_and_a_verdict(end: Callable[[Seen], None], tmp_path: Path) -> None:
    record = tmp_path / "x.log"
    with watched("-w", record, "--color", "never") as seen:
        seen.reader.until(b"rpm")
        wait_until(lambda: record.exists() and record.stat().st_size > 400_000)
        end(seen)
        status, text = seen.ended()
    assert "FAIL" in text
    assert f"tailbyte check {record}" in text
    assert status == 1 == run("check", record).returncode
    assert text.index(" frames = ") < text.index("FAIL")
    assert record.read_bytes().endswith(b"\n")
    assert SCREEN in seen.reader.got
    assert seen.reader.got.count(b"\n! ") == 0  # findings are in the monitor, not written over it


@pytest.mark.slow
def test_a_terminal_that_is_closed_finishes_the_recording(tmp_path: Path) -> None:
    record = tmp_path / "x.mcap"
    with watched("-w", record, flies=HOVER) as seen:
        seen.reader.until(b"rpm")
        seen.terminal.close()
        assert seen.process.wait(LIMIT) is not None
    done = run("decode", "-q", record)
    assert done.returncode == 0
    assert b"not finished" not in done.stderr


@pytest.mark.slow
@pytest.mark.parametrize(("args", "shown"), [(("--list",), b"NodeStatus"), (("-q",), b"\n! ")])
def test_a_terminal_that_is_held_does_not_keep_it(args: tuple[str, ...], shown: bytes, tmp_path: Path) -> None:
    """Ctrl-S, and then SIGTERM: the recording is whole, and nobody hears the verdict."""
    record = tmp_path / "x.mcap"
    with watched(*args, "-w", record, "--color", "never") as seen:
        seen.reader.until(shown)
        seen.press(b"\x13")
        seen.process.send_signal(signal.SIGTERM)
        assert seen.process.wait(LIMIT) in {0, 1, 4}  # however much it has seen
    done = run("decode", "-q", record)
    assert done.returncode == 0
    assert b"not finished" not in done.stderr


@pytest.mark.slow
def test_marks_by_key_and_by_signal_are_in_the_recording(tmp_path: Path) -> None:
    record = tmp_path / "x.log"
    with watched("-w", record, flies=HOVER) as seen:
        seen.reader.until(b"rpm")
        seen.press(b"m")
        wait_until(lambda: b"mark 1" in record.read_bytes())
        seen.process.send_signal(signal.SIGUSR1)
        wait_until(lambda: b"mark 2" in record.read_bytes())
        seen.press(b"q")
        assert seen.ended()[0] in {0, 1, 4}
    assert re.findall(rb"# \(\d+\.\d+\) (mark \d)\n", record.read_bytes()) == [b"mark 1", b"mark 2"]


@pytest.mark.slow
def test_what_is_saved_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with watched() as seen:
        seen.reader.until(b"TYP-")
        seen.press(b"w")
        seen.reader.until(b".txt written")
        seen.press(b"q")
        seen.ended()
    (saved,) = tmp_path.glob("tailbyte-*.txt")
    text = saved.read_text()
    assert text.startswith(f"{BUS}: ")
    assert "! " in text


@pytest.mark.slow
def test_an_end_that_was_asked_for() -> None:
    with watched("-a", "duration:300ms", flies="-") as seen:
        status, text = seen.ended()
    assert status == 4
    assert "NOT JUDGED" in text


@pytest.mark.slow
def test_it_is_drawn_again_when_the_terminal_changes() -> None:
    with watched(flies=HOVER) as seen:
        seen.reader.until(b"rpm")
        assert b"worst gap" not in seen.reader.got
        size(seen.terminal.fileno(), 50, 200)
        seen.reader.until(b"worst gap")
        seen.press(b"q")
        assert seen.ended()[0] in {0, 1, 4}  # it may be too little to judge


@pytest.mark.slow
def test_a_terminal_that_cannot_place_text_gets_a_list() -> None:
    with watched("-c", "50", flies=HOVER, TERM="dumb") as seen:
        _, text = seen.ended()
    assert SCREEN not in seen.reader.got
    assert "ESCStatus" in text


@pytest.mark.slow
@pytest.mark.parametrize("way", ["--view", "v"])
def test_recording_goes_on_while_it_is_looked_through(way: str, tmp_path: Path) -> None:
    record, store = tmp_path / "x.log", tmp_path / "store"
    store.mkdir()
    with watched("-w", record, *([way] if way != "v" else []), flies=HOVER, TMPDIR=str(store)) as seen:
        if way == "v":
            seen.reader.until(b"rpm")
            seen.press(b"v")
        seen.reader.until(b"live, following")
        seen.press(b"\x1b[A=ESCStatus\r")
        seen.reader.until(b"live, held")
        seen.reader.until(b"= ESCStatus")
        before = record.stat().st_size
        wait_until(lambda: record.stat().st_size > before + 100_000)
        seen.press(b"q")
        if way == "v":  # it leads back to the monitor
            wait_until(lambda: not list(store.iterdir()))
            seen.press(b"q")
        status, text = seen.ended()
    assert f"tailbyte check {record}" in text or "frames = " in text
    assert status in (0, 1, 4)
    assert record.read_bytes().endswith(b"\n")
    assert list(store.iterdir()) == []
