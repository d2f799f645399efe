"""Standard streams in every state: full, closed, in a poor encoding, and names that want to take a terminal over."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from kit.command import CODE, HOVER, LIMIT, commands, environment, log, run

from analyzer.app.process import streams

if TYPE_CHECKING:
    from collections.abc import Callable

    Command = Callable[..., tuple[int, str, str]]

FRAME = b"1F040601#00000000000000C0"
FULL = Path("/dev/full")


@pytest.mark.slow
@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize(
    "args",
    [["decode", HOVER], ["decode", HOVER, "-T", "jsonl"], ["decode", HOVER, "-V"], ["decode", HOVER, "-c", 1],
     ["info", HOVER], ["--help"], ["--version"]],
    ids=lambda args: " ".join(map(str, args[:1] + args[2:])),
)  # fmt: skip
def test_output_that_cannot_be_written(args: list[object], unbuffered: str) -> None:
    with FULL.open("wb") as full:
        done = run(*args, stdout=full, env={"PYTHONUNBUFFERED": unbuffered})
    assert (done.returncode, done.stderr) == (3, b"tailbyte: standard output: No space left on device\n")


@pytest.mark.slow
def test_quiet_needs_no_output() -> None:
    with FULL.open("wb") as full:
        assert run("decode", "-q", HOVER, stdout=full).returncode == 0


def closed(*args: object, streams: str) -> subprocess.CompletedProcess[bytes]:
    """Through a shell, the only one who can leave streams closed."""
    command = ["sh", "-c", f'exec "$0" -c "$@" {streams}', sys.executable, CODE, *map(str, args)]
    return subprocess.run(command, env=environment(), capture_output=True, timeout=LIMIT, check=False)


@pytest.mark.slow
def test_closed_streams() -> None:
    done = closed("decode", HOVER, streams=">&-")
    assert (done.returncode, done.stderr) == (3, b"tailbyte: standard output: Bad file descriptor\n")
    assert closed("info", HOVER, streams=">&-").returncode == 3
    assert closed("decode", "-q", HOVER, streams=">&-").returncode == 0
    done = closed("decode", "-", streams="<&-")
    assert (done.returncode, done.stderr.splitlines()[0]) == (3, b"tailbyte: -: byte 0: Bad file descriptor")


@pytest.mark.slow
@pytest.mark.parametrize("streams", ["2>&-", "2>/dev/full"])
def test_complaints_that_nobody_can_read(streams: str) -> None:
    whole = run("decode", HOVER).stdout
    done = closed("decode", HOVER, streams=streams)
    assert (done.returncode, done.stdout) == (0, whole)
    assert closed("decode", "/missing", streams=streams).returncode == 3
    assert closed("decode", streams=streams).returncode == 2
    assert closed("decode", "/missing", streams=f"<&- >&- {streams}").returncode == 3


@pytest.fixture
def hostile(tmp_path: Path) -> Path:
    """Interface names with an escape sequence, letters that are none of ASCII, and no text at all."""
    path = tmp_path / "names.log"
    names = (b"a\x1b[31m", "bé".encode(), b"c\xff", "d\u202e".encode())
    path.write_bytes(b"".join(b"(1.%06d) %s %s\n" % (k, name, FRAME) for k, name in enumerate(names)))
    return path


@pytest.mark.slow
@pytest.mark.parametrize(
    "args", [[], ["-V"], ["-x"], ["-T", "jsonl"], ["-T", "csv"], ["-T", "fields", "-e", "frame.interface_name"]]
)
def test_names_in_a_capture_cannot_reach_the_terminal(command: Command, hostile: Path, args: list[str]) -> None:
    for do in (["decode", *args], ["info"], ["info", "-T", "json"]):
        _, out, err = command(*do, hostile)
        assert (out + err).replace("\r", "").replace("\n", "").isprintable(), do
    done = run("decode", *args, hostile)
    assert b"\x1b" not in done.stdout + done.stderr
    assert b"\xff" not in done.stdout + done.stderr


@pytest.mark.slow
@pytest.mark.parametrize(
    "env",
    [
        {"PYTHONIOENCODING": "ascii"},
        {"LC_ALL": "C"},
        {"LC_ALL": "POSIX", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"},
    ],
)
def test_encodings_that_lack_letters(command: Command, hostile: Path, env: dict[str, str]) -> None:
    for args in (["decode"], ["decode", "-V"], ["info"], ["info", "-T", "json"]):
        done = run(*args, hostile, env=env)
        assert (done.returncode, b"Traceback" in done.stderr) == (0, False)
        assert len(done.stdout.splitlines()) == len(command(*args, hostile)[1].splitlines())
    assert run("decode", "--help", env=env).returncode == 0
    done = run("decode", "né", env=env)
    assert (done.returncode, done.stderr.count(b"\n"), b"Traceback" in done.stderr) == (3, 1, False)


@pytest.mark.slow
def test_an_ellipsis_degrades_to_one_letter(hostile: Path) -> None:
    hostile.write_bytes(log(commands(0, bus="a-name-of-many-letters")) + log(commands(1000, bus="another")))
    shown = run("info", hostile).stdout.decode()
    assert "…" in shown
    assert run("info", hostile, env={"PYTHONIOENCODING": "ascii"}).stdout.decode() == shown.replace("…", "~")


@pytest.mark.skipif(not hasattr(signal, "SIGALRM"), reason="there are no alarms here")
def test_what_nobody_takes_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """A pipe that is full stands in for a terminal that is held."""
    given_up: list[int] = []
    monkeypatch.setattr(streams, "forget", given_up.append)
    ends = os.pipe()
    before = signal.getsignal(signal.SIGALRM)
    with streams.bounded(0.05, wanted=True):
        while True:
            os.write(ends[1], bytes(1 << 16))
    assert given_up == [1, 2]
    with streams.bounded(0.0, wanted=False):
        given_up.clear()
    with streams.bounded(60.0, wanted=True):
        pass
    assert (given_up, signal.getitimer(signal.ITIMER_REAL), signal.getsignal(signal.SIGALRM)) == (
        [],
        (0.0, 0.0),
        before,
    )
    for end in ends:
        os.close(end)
