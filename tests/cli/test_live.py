"""Captures that are still being written, and Ctrl-C at any time."""

from __future__ import annotations

import fcntl
import gzip
import signal
import subprocess
import sys
import termios
from typing import TYPE_CHECKING

import pytest
from kit.command import CODE, HOVER, LIMIT, Reader, commands, environment, log, run, start, wait_until

if TYPE_CHECKING:
    from pathlib import Path

MS = 1_000_000
SHOWN = ("-T", "fields", "-e", "RawCommand.cmd")


class Live:
    """The command while it runs; both its streams are read."""

    def __init__(self, *args: object) -> None:
        pipe = subprocess.PIPE
        self.process = start(*args, stdin=pipe, stdout=pipe, stderr=pipe)
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        assert self.process.stderr is not None
        self.input, self._errors = self.process.stdin, self.process.stderr
        self.output = Reader(self.process.stdout.fileno())

    def send(self, data: bytes) -> None:
        self.input.write(data)
        self.input.flush()

    def taken(self) -> bool:
        """Whether nothing is left in the pipe."""
        assert self.process.poll() is None
        return not any(fcntl.ioctl(self.input, termios.FIONREAD, b"\0" * 4))

    def interrupt(self) -> None:
        self.process.send_signal(signal.SIGINT)

    def end(self) -> tuple[int, bytes, bytes]:
        """Status, everything it wrote, its complaints."""
        with self.process:
            self.input.close()
            out, err = self.output.rest(), self._errors.read()
            return self.process.wait(LIMIT), out, err


@pytest.mark.slow
def test_a_growing_file_is_followed(tmp_path: Path) -> None:
    """Written, appended to in halves of a line, emptied and written anew; Ctrl-C ends it.

    A line that is not whole by then is no damage.
    """
    lines = [log(commands(k * MS, first=k)) for k in range(3)]
    path = tmp_path / "growing.log"
    path.touch()
    live = Live("decode", "--follow", *SHOWN, path)
    with path.open("ab", buffering=0) as file:
        file.write(lines[0] + lines[1])
        live.output.until(b"0,0\n1,0\n")
        file.write(lines[2][:30])
        file.write(lines[2][30:])
        live.output.until(b"2,0\n")
        file.write(b"(1773475339.0")
    path.write_bytes(lines[1])
    live.output.until(b"2,0\n1,0\n")
    with path.open("ab", buffering=0) as file:
        file.write(lines[2].rstrip(b"\n"))  # the end of this line never comes
    live.interrupt()
    status, out, err = live.end()
    assert (status, out) == (130, b"0,0\n1,0\n2,0\n1,0\n")
    assert b"Traceback" not in err
    assert b"4 of 4 transfers shown" in err
    assert b"ends in the middle" not in err


@pytest.mark.slow
def test_a_packed_file_is_followed(tmp_path: Path) -> None:

    path = tmp_path / "growing.gz"
    path.write_bytes(gzip.compress(log(commands(0))))
    live = Live("decode", "--follow", *SHOWN, path)
    live.output.until(b"0,0\n")
    with path.open("ab", buffering=0) as file:
        file.write(gzip.compress(log(commands(MS, first=1))))
    live.output.until(b"1,0\n")
    live.interrupt()
    status, out, err = live.end()
    assert (status, out) == (130, b"0,0\n1,0\n")
    assert b"gzip" not in err.replace(b".gz", b"")


@pytest.mark.slow
def test_a_pipe_is_shown_as_it_comes_and_to_its_end() -> None:
    live = Live("decode", "--follow", *SHOWN, "-")
    for k in range(3):
        live.send(log(commands(k * MS, first=k)))
        live.output.until(b"%d,0\n" % k)
    status, out, err = live.end()
    assert (status, out) == (0, b"0,0\n1,0\n2,0\n")
    assert err.startswith(b"-- 3 of 3 ")


@pytest.mark.slow
@pytest.mark.parametrize("form", ["text", "json", "jsonl"])
def test_ctrl_c_while_a_pipe_is_read(form: str) -> None:
    """What has come is shown in whole lines, the account too, and a JSON array is closed."""
    half = HOVER.read_bytes()[:30_000]
    live = Live("decode", "-T", form, "-")
    live.send(half)
    wait_until(live.taken)
    live.interrupt()
    status, out, err = live.end()
    expected = run("decode", "-T", form, "-", input=half[: half.rindex(b"\n") + 1])
    assert (status, out, err) == (130, expected.stdout, expected.stderr)
    assert out.endswith(b"]\n" if form == "json" else b"\n")


@pytest.mark.slow
def test_ctrl_c_gives_info_of_what_has_come() -> None:
    live = Live("info", "-")
    live.send(log(commands(*range(0, 50 * MS, MS))))
    wait_until(live.taken)
    live.interrupt()
    status, out, _ = live.end()
    assert status == 130
    assert b"50 = 50 frames" in out


@pytest.mark.sampled(4)
@pytest.mark.parametrize(
    "module",
    [
        "analyzer.cli.decode",
        "analyzer.app.run",
        "numpy",
        "pyarrow",
        "pyarrow.lib",
        "dissectors",
        "analyzer._native",
    ],
)
def test_ctrl_c_during_an_import(module: str) -> None:
    code = (
        "import os, signal, sys\n"
        "wanted = sys.argv.pop(1)\n"
        "class Finder:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name == wanted:\n"
        "            sys.meta_path.remove(self)\n"
        "            os.kill(os.getpid(), signal.SIGINT)\n"
        "sys.meta_path.insert(0, Finder())\n"
        "from analyzer.cli import main\n"
        "sys.exit(main())"
    )
    command = [sys.executable, "-c", code, module, "decode", str(HOVER)]
    done = subprocess.run(command, env=environment(), capture_output=True, timeout=LIMIT, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (130, b"", b"")


@pytest.mark.slow
def test_a_background_job_ignores_ctrl_c() -> None:
    """As shells start one: SIGINT is ignored from the beginning."""
    code = "import signal, os, sys; signal.signal(signal.SIGINT, signal.SIG_IGN); os.execv(sys.argv[1], sys.argv[1:])"
    inner = f"import os; os.kill(os.getpid(), 2); {CODE}"
    command = [sys.executable, "-c", code, sys.executable, "-c", inner, "decode", "-q", str(HOVER)]
    done = subprocess.run(command, env=environment(), capture_output=True, timeout=LIMIT, check=False)
    assert (done.returncode, done.stderr[:16]) == (0, b"-- 1111 transfer")
