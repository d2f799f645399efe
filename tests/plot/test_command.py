"""Where `tailbyte plot` takes a recording: a window, pages for a browser, a viewer that runs, or a file instead."""

from __future__ import annotations

import os
import re
import select
import signal
import socket
import subprocess
import sys
import urllib.request
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from kit.command import HOVER, LIMIT, Reader, environment, run, start, wait_until
from kit.pictures import Drawn, deaf, draw, keeper, read_back, taken

from analyzer.plot import viewer_program as plot_viewer

if TYPE_CHECKING:
    from collections.abc import Callable

    Command = Callable[..., tuple[int, str, str]]


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.delenv("DISPLAY", raising=False)
    Path("flight.log").write_bytes(HOVER.read_bytes())
    return tmp_path


def whole(got: Drawn) -> bool:
    wanted, _ = draw(HOVER.read_bytes())
    return all(got.points(path) == wanted.points(path) for path in wanted.under("/voltage/"))


@pytest.mark.slow
def test_a_viewer_that_runs_gets_all_of_it(command: Command, tmp_path: Path) -> None:
    with keeper(tmp_path) as (address, kept):
        status, out, err = command("plot", "flight.log", "--connect", str(address))
        assert (status, out) == (0, "")
        assert f"shown by {address}" in err
        wait_until(lambda: "/summary" in taken(kept).static)
        assert whole(taken(kept))
    assert not Path("flight.rrd").exists()


def test_no_viewer_there(command: Command) -> None:
    port = plot_viewer.free_port("127.0.0.1")
    status, _, err = command("plot", "flight.log", "--connect", str(port))
    assert status == 3
    assert err.count("\n") == 1
    assert f"rerun+http://127.0.0.1:{port}/proxy: no viewer is there" in err


@pytest.mark.slow
def test_a_viewer_that_closes_is_one_line(tmp_path: Path) -> None:
    with deaf(closes=True) as address:
        done = run("plot", tmp_path / "flight.log", "--connect", address)
    assert done.returncode == 3
    assert done.stderr.count(b"\n") == 1
    assert b"the viewer has closed the connection" in done.stderr


@pytest.mark.parametrize(
    ("args", "text"),
    [
        (("--connect", "http://a"), "no viewer's address"),
        (("--connect", "1", "--serve"), "not allowed with"),
        (("-o", "a.rrd", "--serve"), "not allowed with"),
        (("--port", "1"), "--port and --bind go with --serve"),
        (("--serve", "--port", "x"), "is no port"),
        (("--serve", "--bind", "localhost"), "is no IP address"),
    ],
)
def test_wrong_usage(command: Command, args: tuple[str, ...], text: str) -> None:
    status, _, err = command("plot", "flight.log", *args)
    assert status == 2
    assert text in err


@pytest.mark.slow
def test_without_a_display_a_file_and_how_to_open_it(command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plot_viewer, "display", lambda: False)
    status, _, err = command("plot", "flight.log")
    assert status == 0
    assert "written to flight.rrd" in err
    assert "rerun flight.rrd" in err
    assert whole(read_back(Path("flight.rrd")))


@pytest.mark.slow
@pytest.mark.parametrize("program", ["/bin/false", "nothing.exe"])
def test_without_a_viewer_that_starts_a_file(tmp_path: Path, program: str) -> None:
    done = run("plot", tmp_path / "flight.log", env={"DISPLAY": ":0", "RERUN_CLI_PATH": program})
    assert done.returncode == 0
    assert (b"does not start" in done.stderr) == (program == "/bin/false")
    assert b"flight.rrd" in done.stderr
    assert whole(read_back(tmp_path / "flight.rrd"))


def script(folder: Path) -> Path:
    """A viewer that needs no display: it takes Rerun's options, tells its process, and writes what it is sent."""
    program = folder / "viewer"
    kept, told = folder / "kept.rrd", folder / "pid"
    program.write_text(
        f"#!{sys.executable}\nimport os, sys\nopen({str(told)!r}, 'w').write(str(os.getpid()))\n"
        f"options = [one for one in sys.argv[1:] if one not in ('--hide-welcome-screen', '--expect-data-soon')]\n"
        f"os.execv({plot_viewer.binary()!r}, ['rerun', *options, '--save', {str(kept)!r}])\n"
    )
    program.chmod(0o755)
    return program


@pytest.mark.slow
def test_a_window_outlives_the_command(tmp_path: Path) -> None:
    viewer = script(tmp_path)
    done = run("plot", tmp_path / "flight.log", env={"DISPLAY": ":0", "RERUN_CLI_PATH": str(viewer)})
    process = int((tmp_path / "pid").read_text())
    try:
        assert done.returncode == 0, done.stderr
        assert b"shown by rerun+http://127.0.0.1:" in done.stderr
        assert not (tmp_path / "flight.rrd").exists()
        assert os.getsid(process) != os.getsid(0)
        wait_until(lambda: "/summary" in taken(tmp_path / "kept.rrd").static)
        assert whole(taken(tmp_path / "kept.rrd"))
    finally:
        os.kill(process, signal.SIGKILL)


@pytest.mark.slow
@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 0), (signal.SIGTERM, 143)])
def test_pages_for_a_browser_until_ctrl_c(tmp_path: Path, number: int, status: int) -> None:
    process = start("plot", tmp_path / "flight.log", "--serve", stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stdout is not None
    assert process.stderr is not None
    out, err = Reader(process.stdout.fileno()), Reader(process.stderr.fileno())
    url = out.until(b"\n").decode().strip()
    assert url.startswith("http://127.0.0.1:")
    err.until(b"Ctrl-C")
    with urllib.request.urlopen(url) as page:
        assert page.status == 200
    found = re.search(r"127\.0\.0\.1%3A(\d+)", url)
    assert found is not None
    port = int(found[1])
    socket.create_connection(("127.0.0.1", port)).close()
    process.send_signal(number)
    assert process.wait(60) == status
    with pytest.raises(OSError, match="refused"):
        socket.create_connection(("127.0.0.1", port))
    process.stdout.close()
    process.stderr.close()


@pytest.mark.slow
def test_what_a_pipe_has_delivered_is_served_after_ctrl_c() -> None:
    """The first one ends the reading, the second one the pages."""
    ends = os.pipe()
    with os.fdopen(ends[1], "wb") as into, os.fdopen(ends[0], "rb") as source:
        process = start("plot", "-", "--serve", stdin=source, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        into.write(HOVER.read_bytes())
        into.flush()
        assert process.stdout is not None
        assert process.stderr is not None
        Reader(process.stdout.fileno()).until(b"\n")
        wait_until(lambda: not waiting(source.fileno()))
        process.send_signal(signal.SIGINT)
        Reader(process.stderr.fileno()).until(b"Ctrl-C")
        process.send_signal(signal.SIGINT)
        assert process.wait(60) == 130
    process.stdout.close()
    process.stderr.close()


def waiting(pipe: int) -> bool:
    """Whether something is in it that nobody has read."""
    return bool(select.select([pipe], [], [], 0)[0])


def test_a_port_in_use_is_said(command: Command) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken_port:
        number = taken_port.getsockname()[1]
        status, out, err = command("plot", "flight.log", "--serve", "--port", str(number))
    assert (status, out) == (3, "")
    assert f"127.0.0.1 port {number} is in use" in err


@pytest.mark.slow
def test_a_missing_capture_opens_no_viewer(tmp_path: Path) -> None:
    viewer = script(tmp_path)
    for more in ((), ("--serve",)):
        done = run("plot", tmp_path / "none.log", *more, env={"DISPLAY": ":0", "RERUN_CLI_PATH": str(viewer)})
        assert done.returncode == 3
        assert done.stdout == b""
    assert not (tmp_path / "pid").exists()


PROGRAM = """
import sys
from analyzer.cli import main
sys.argv = ["tailbyte", "plot", "flight.log", "-o", "a.rrd"]
status = main({})
print(status, "pandas" in sys.modules)
import pyarrow
print(type(pyarrow.array([1]).to_pandas()).__name__)
"""


@pytest.mark.slow
def test_the_program_does_without_pandas_and_leaves_it_to_others() -> None:
    def told(arguments: str) -> list[str]:
        command = [sys.executable, "-c", PROGRAM.format(arguments)]
        done = subprocess.run(command, capture_output=True, text=True, env=environment(), timeout=LIMIT, check=False)
        return done.stdout.splitlines()

    assert told("")[0] == "0 False"
    assert told("sys.argv[1:]")[-1] == "Series"
