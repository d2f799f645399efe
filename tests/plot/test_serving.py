"""What is served is for this computer's user alone, and ends with the command, however that ends."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from threading import Thread
from typing import TYPE_CHECKING

import pytest
from kit.command import LIMIT, environment, wait_until

from analyzer.plot.serving import server as serving
from analyzer.plot.serving.gate import HostGate, is_ours
from analyzer.plot.viewer_program import NoViewerError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

HERE = "127.0.0.1"
ANSWER = b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\nok"


@pytest.fixture
def port() -> Iterator[int]:
    """The port of a gate in front of a server that answers everything, with what it was asked."""
    with socket.create_server((HERE, 0)) as listening:

        def serve() -> None:
            while True:
                try:
                    came, _ = listening.accept()
                except OSError:
                    return
                with came:
                    came.sendall(ANSWER + came.recv(1 << 16))

        Thread(target=serve, daemon=True).start()
        gate = HostGate(HERE, 0, listening.getsockname()[:2])
        yield gate.port
        gate.close()
        with pytest.raises(OSError, match="refused"):
            socket.create_connection((HERE, gate.port))
        listening.shutdown(socket.SHUT_RDWR)


def asked(port: int, *pieces: bytes) -> bytes:
    with socket.create_connection((HERE, port)) as one:
        one.settimeout(LIMIT)
        for piece in pieces:
            one.sendall(piece)
        one.shutdown(socket.SHUT_WR)
        got = b""
        while more := one.recv(1 << 16):
            got += more
    return got


@pytest.mark.parametrize("host", [b"127.0.0.1:9090", b"localhost:1", b"[::1]:80", b"[::1]", b"10.0.0.7"])
def test_this_computer_is_served(host: bytes, port: int) -> None:
    head = b"GET / HTTP/1.1\r\nAccept: x\r\nhOST:  " + host + b"\r\n\r\n"
    assert asked(port, head[:10], head[10:]) == ANSWER + head


@pytest.mark.parametrize(
    "head",
    [
        b"Host: example.com\r\n", b"Host: 127.0.0.1.example.com:9090\r\n", b"", b"Host:\r\n",
        b"Host: localhost\r\nHost: example.com\r\n", b"Host: localhost.example.com\r\n",
    ],
)  # fmt: skip
def test_other_hosts_are_refused(head: bytes, port: int) -> None:
    """A page that gives its name an address of this computer, and whoever does not say whom they mean."""
    got = asked(port, b"GET / HTTP/1.1\r\n" + head + b"\r\n")
    assert got.startswith(b"HTTP/1.1 403 ")
    assert got.endswith(b"\r\n\r\nthis is not that computer\n")
    assert b"Content-Length: 26\r\n" in got


def test_viewers_are_let_through(port: int) -> None:
    """They speak HTTP/2 at once, which no browser does without encryption."""
    preface = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"
    assert asked(port, preface) == ANSWER + preface


def test_a_head_without_an_end_is_refused(port: int) -> None:
    with socket.create_connection((HERE, port)) as one:
        try:
            one.sendall(b"GET / HTTP/1.1\r\nHost: localhost\r\nX: " + b"x" * (1 << 17))
            assert one.recv(1 << 16).startswith(b"HTTP/1.1 403 ")
        except ConnectionError:  # what it had not read is no longer wanted
            pass


def test_names_of_this_computer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(socket, "gethostname", lambda: "Bench-7")
    assert is_ours("bench-7:9090")
    assert not is_ours("bench-8:9090")


def test_a_port_that_is_taken() -> None:
    with socket.create_server((HERE, 0)) as taken:
        number = taken.getsockname()[1]
        with pytest.raises(NoViewerError, match=f"{HERE} port {number} is in use"):
            serving.Server(HERE, number)


PROGRAM = """
import sys
from unittest import mock
from analyzer.plot.serving import server
with mock.patch.object(server, "wait_for", lambda *_: None):
    server.Server("127.0.0.1", None)
print("ready", flush=True)
sys.stdin.read()
"""
VIEWER = """#!/bin/sh
echo $$ > "$TOLD"
exec sleep 1000
"""


@pytest.mark.skipif(sys.platform == "win32", reason="a shell script stands in for the viewer")
def test_it_ends_with_its_parent(tmp_path: Path) -> None:
    """Killed, that cleans up nothing."""
    viewer, told = tmp_path / "viewer", tmp_path / "pid"
    viewer.write_text(VIEWER)
    viewer.chmod(0o755)
    env = environment() | {"RERUN_CLI_PATH": str(viewer), "TOLD": str(told)}
    pipe = subprocess.PIPE
    with subprocess.Popen([sys.executable, "-c", PROGRAM], env=env, stdin=pipe, stdout=pipe) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"ready\n"
        wait_until(lambda: told.exists() and told.read_text().endswith("\n"))
        number = int(told.read_text())
        os.kill(number, 0)
        process.send_signal(signal.SIGKILL)
        assert process.wait(LIMIT) == -signal.SIGKILL
    wait_until(lambda: not runs(number))


def runs(number: int) -> bool:
    try:
        os.kill(number, 0)
    except ProcessLookupError:
        return False
    return True
