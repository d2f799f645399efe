"""The two terminals that the pages show for a bus without hardware: one end in this process, one in another."""

from __future__ import annotations

import re
import shlex
import signal
import socket
from typing import TYPE_CHECKING

import pytest
from kit.command import LIMIT, start
from kit.pages import PAGES, ROOT, blocks

from analyzer.cli import main

if TYPE_CHECKING:
    from collections.abc import Iterator

FRAMES = 200
BUS = "udp_multicast:239.74.163.2"


def terminals() -> Iterator[tuple[str, str]]:
    """What the first terminal is given, and what the second."""
    for page in PAGES:
        watching = ""
        for block in (block for block in blocks(page) if block.kind == "sh"):
            lines = [line.replace("$BUS", BUS) for line in block.lines()]
            for line in (line for line in lines if BUS in line and line.startswith("tailbyte")):
                if line.startswith("tailbyte live"):
                    watching = line
                else:
                    yield watching, line


TERMINALS = sorted(set(terminals()))


def test_there_are_some() -> None:
    assert {re.split(" +", line)[1] for _, line in TERMINALS} == {"replay", "simulate"}


@pytest.fixture
def port() -> int:
    """A bus of its own: what else runs on this machine is on another port."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


@pytest.mark.slow
@pytest.mark.parametrize(("watching", "sending"), TERMINALS)
def test_what_one_sends_the_other_sees(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    port: int,
    watching: str,
    sending: str,
) -> None:
    assert watching
    monkeypatch.chdir(ROOT)
    only_here = ["--bus-kwargs", f"port={port}"]
    with start(*shlex.split(sending, comments=True)[1:], *only_here) as sender:
        try:
            status = main([*shlex.split(watching)[1:], *only_here, "-q", "-c", str(FRAMES), "-a", f"duration:{LIMIT}"])
        finally:
            sender.send_signal(signal.SIGINT)
    said = capsys.readouterr().err
    if "without a network it takes a route" in said:
        pytest.skip("no way for multicast on this machine")
    assert status in (0, 1, 4), said
    assert f"enough: {FRAMES} frames" in said
    assert sender.returncode == 130
