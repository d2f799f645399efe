"""`tailbyte simulate` that ends too early: signals, full disks, outputs that cannot be written, readers that leave."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from kit.command import CODE, LIMIT, environment, run, run_in_room, start

if TYPE_CHECKING:
    from collections.abc import Callable

    Command = Callable[..., tuple[int, str, str]]

SHORT = ("--duration", "300ms", "--seed", "5")


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def files() -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in Path().iterdir()}


STOPPED = """
import os, signal, sys
import analyzer.simulate.recorder as recorder
record = recorder.SimulatedRecorder.record
def stopping(self, frames):
    for number, frame in enumerate(record(self, frames)):
        if number == 1500:
            os.kill(os.getpid(), signal.{name})
        yield frame
recorder.SimulatedRecorder.record = stopping
"""


@pytest.mark.slow
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
@pytest.mark.parametrize("suffix", ["log", "mcap"])
def test_whoever_ends_it_leaves_what_was_there(suffix: str, name: str) -> None:
    Path(f"out.{suffix}").write_text("old")
    args = ["simulate", "-o", f"out.{suffix}", "--key", "key.json", "--duration", "24h"]
    code = STOPPED.format(name=name) + CODE
    done = subprocess.run(
        [sys.executable, "-c", code, *args], env=environment(), capture_output=True, timeout=LIMIT, check=False
    )
    number = signal.Signals[name]
    said = b"tailbyte: interrupted, nothing is written\n" if name == "SIGINT" else b""
    status = 130 if name == "SIGINT" else 128 + number
    assert (done.returncode, done.stdout, done.stderr) == (status, b"", said)
    assert files() == {f"out.{suffix}": b"old"}


@pytest.mark.slow
def test_ctrl_c_after_the_last_frame_is_heard() -> None:
    code = STOPPED.format(name="SIGINT") + CODE
    args = ["simulate", "-o", "out.log", "--duration", "2"]
    done = subprocess.run(
        [sys.executable, "-c", code.replace("1500", "3"), *args],
        env=environment(), capture_output=True, timeout=LIMIT, check=False,
    )  # fmt: skip
    assert (done.returncode, files()) == (130, {})


@pytest.mark.slow
@pytest.mark.parametrize("name", ["out.log", "out.log.gz", "out.mcap", "out.pcapng"])
@pytest.mark.parametrize("room", [0, 3000])
def test_a_full_disk(name: str, room: int) -> None:
    done = run_in_room(room, "simulate", "-o", name, "--key", "key.json", "--duration", "2")
    assert (done.returncode, done.stdout, done.stderr.decode()) == (3, b"", f"tailbyte: {name}: File too large\n")
    assert files() == {}


def test_a_key_that_cannot_be_written_leaves_no_capture(command: Command) -> None:
    for key, reason in (("/dev/full", "No space left on device"), ("no/key", "there is no folder no"), (".", None)):
        status, _, err = command("simulate", "-o", "out.log", "--key", key, *SHORT)
        assert (status, err.count("\n"), files()) == (3, 1, {})
        assert reason is None or err == f"tailbyte: {key}: {reason}\n"


@pytest.mark.slow
def test_outputs_that_cannot_be_written(command: Command) -> None:
    for out, reason in (
        (".", "is a directory"), ("no/out", "there is no folder no"), ("/dev/full", "No space left on device"),
    ):  # fmt: skip
        wanted = ("-F", "candump", "--key", "key.json", *SHORT)
        assert command("simulate", "-o", out, *wanted) == (3, "", f"tailbyte: {out}: {reason}\n")
        assert files() == {}
    with Path("/dev/full").open("wb") as full:
        done = run("simulate", "-o", "-", *SHORT, stdout=full)
    assert (done.returncode, done.stderr) == (3, b"tailbyte: standard output: No space left on device\n")


@pytest.mark.slow
def test_a_reader_that_leaves() -> None:
    pipe = subprocess.PIPE
    with start("simulate", "-o", "-", "--duration", "24h", stdout=pipe, stderr=pipe) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.read(10)
        process.stdout.close()
        assert (process.stderr.read(), process.wait(LIMIT)) == (b"", 0)
