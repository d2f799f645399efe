"""`tailbyte replay` with buses that fail, captures that are damaged, and people who change their minds."""

from __future__ import annotations

import errno
import gzip
import os
import signal
import threading
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import can
import pytest
from kit.command import CAPTURES, HOVER
from kit.live import Failing, got
from kit.rows import Fault, Frame
from kit.waiting import START, Clock, frames, log, replays_wait_by

from analyzer.app import reel as replay_reel
from analyzer.live.replay import outlet

if TYPE_CHECKING:
    from collections.abc import Callable

    Command = Callable[..., tuple[int, str, str]]

pytestmark = pytest.mark.usefixtures("no_can_configuration", "clock")


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    return replays_wait_by(Clock(), monkeypatch)


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (can.CanOperationError("Failed to transmit: Network is down", errno.ENETDOWN), "is down"),
        (can.CanOperationError("Failed to transmit: No such device", errno.ENODEV), "has been removed"),
        (can.CanOperationError("Transmit buffer full"), "its transmit buffer stays full: "),
    ],
)
def test_a_bus_that_fails(command: Command, monkeypatch: pytest.MonkeyPatch, error: Exception, reason: str) -> None:
    bus, clock = Failing(20, error), Clock()
    monkeypatch.setattr(can, "Bus", lambda **_: bus)
    monkeypatch.setattr(outlet, "Sender", partial(outlet.Sender, clock=clock, sleep=clock.sleep))
    status, _, err = command("replay", HOVER, "virtual:x")
    lines = err.splitlines()
    assert (status, bus.sent, len(lines)) == (3, 20, 2)
    assert lines[0] == "-- 20 frames, 0.0 s sent on virtual:x; 1868 lines = 1868 frames"
    assert lines[1].startswith(f"tailbyte: virtual:x: {reason}")


def test_a_bus_that_cannot_be_opened(command: Command) -> None:
    status, out, err = command("replay", HOVER, "no-such-can")  # whatever this machine has
    assert (status, out, err.count("\n")) == (3, "", 1)
    assert err.startswith("tailbyte: no-such-can: ")


def test_a_group_that_no_network_reaches(command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(**_: object) -> None:
        raise can.CanInitializationError("could not create") from OSError(errno.ENODEV, "No such device")

    monkeypatch.setattr(can, "Bus", fail)
    status, _, err = command("replay", HOVER, "udp_multicast:239.74.163.2")
    reason = "without a network it takes a route, on Linux: ip route add 239.0.0.0/8 dev lo"
    assert (status, err) == (3, f"tailbyte: udp_multicast:239.74.163.2: {reason}\n")
    assert command("replay", HOVER, "virtual:x") == (3, "", "tailbyte: virtual:x: could not create\n")


def test_captures_that_are_not_what_they_should_be(command: Command, receiver: can.BusABC) -> None:
    Path("cut.log.gz").write_bytes(gzip.compress(HOVER.read_bytes())[:-2000])
    status, _, err = command("replay", "cut.log.gz", "virtual:here")
    sent = len(got(receiver))
    assert (status, 500 < sent < 1868) == (3, True)
    assert f"-- {sent:,} frames, " in err
    Path("empty.log").touch()
    for name, reason in (("none.log", "No such file or directory"), ("empty.log", "empty")):
        status, _, err = command("replay", name, "virtual:here")
        assert (status, err.splitlines()[0], got(receiver)) == (3, f"tailbyte: {name}: {reason}", [])


def interrupted(command: Command, receiver: can.BusABC, *args: object) -> tuple[int, str, str]:
    """Ctrl-C when ten frames have arrived."""

    def interrupt() -> None:
        for _ in range(10):
            assert receiver.recv(30) is not None
        os.kill(os.getpid(), signal.SIGINT)

    reader = threading.Thread(target=interrupt)
    reader.start()
    result = command("replay", *args)
    reader.join()
    return result


def test_ctrl_c_ends_it(command: Command, receiver: can.BusABC) -> None:
    """An endless one as well as a long wait."""
    for args in ((HOVER, "--loop", "inf"), (log("x.log", [*frames(*range(10)), Frame(START + 2**61)]),)):
        status, out, err = interrupted(command, receiver, *args, "virtual:here")
        sent = 10 + len(got(receiver))
        assert (status, out) == (130, "")
        assert f"-- {sent:,} frames, " in err


def test_ctrl_c_ends_what_is_read_again_and_again(
    command: Command, receiver: can.BusABC, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Even with the last frame of a round, when nothing of the file is left to be stopped."""
    monkeypatch.setattr(replay_reel, "MOST_HELD", 1)
    send, sent = outlet.Outlet.send, 0

    def counted(self: outlet.Outlet, frame: outlet.Sendable, **how: bool) -> bool:
        nonlocal sent
        sent += 1
        if sent == 4:
            os.kill(os.getpid(), signal.SIGINT)
        assert sent < 9
        return send(self, frame, **how)

    monkeypatch.setattr(outlet.Outlet, "send", counted)
    assert command("replay", log("x.log", frames(1, 2)), "virtual:here", "--loop", "inf")[0] == 130
    assert len(got(receiver)) == 4


def test_ctrl_c_before_anything_is_sent(
    command: Command, receiver: can.BusABC, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(replay_reel.Reel, "_note", lambda *_: os.kill(os.getpid(), signal.SIGINT))
    status, out, err = command("replay", HOVER, "virtual:here")
    assert (status, out, err, got(receiver)) == (130, "", "tailbyte: interrupted, nothing is sent\n", [])


@pytest.mark.parametrize(
    ("args", "reason"),
    [
        (["x.log"], "where to? give an interface such as vcan0 behind the captures: x.log is none (-i takes any name"),
        (["vcan0"], "which capture? give a file, or - for standard input"),
        (["x.log", "vcan0="], "'vcan0=' is not IFACE=BUS, as in vcan0=can0"),
        (["x.log", "vcan0=can0", "-i", "vcan1"],
         "vcan0=can0 and vcan1: either interfaces alone, or with a bus each"),
        (["x.log", "vitrual:x"], "vitrual:x: no interface type is called 'vitrual' (near: virtual)"),
        (["x.log", "vcan0", "--speed", "fast"], "--speed: 'fast' is no number (0.5, 10, or max)"),
        (["x.log", "vcan0", "--loop", "0"], "--loop: '0' is not a number of at least 1, nor inf"),
        (["x.log", "vcan0", "--max-gap", "x"], "--max-gap: 'x' is not a duration (10s, 250ms, 1.5min)"),
        (["x.log", "vcan0", "--from", "x"], "--from: 'x' is not a time (12.5, 12:49:54.890 or 2026-03-14T12:49:54)"),
        (["x.log", "vcan0", "-f", "x"], "'x' is no filter: "),
    ],
)  # fmt: skip
def test_what_is_refused(command: Command, args: list[str], reason: str) -> None:
    log("x.log", frames(1))
    status, out, err = command("replay", *args)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert err.startswith(f"tailbyte replay: {reason}")


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (("--from", "5"), "no frame is inside the window"),
        (("-f", "7FF:7FF"), "no frame passes the filters"),
        (("-f", "7FF:7FF", "--frames", "1"), "no frame is inside the window and passes the filters"),
        (("--around", "999"), "no frame 999: the capture has 3"),
    ],
)
def test_nothing_to_send(command: Command, receiver: can.BusABC, options: tuple[str, ...], reason: str) -> None:
    status, out, err = command("replay", log("x.log", frames(1, 2, 3)), "virtual:here", *options)
    assert (status, out, err, got(receiver)) == (2, "", f"tailbyte: x.log: {reason}\n", [])


def test_only_error_frames(command: Command) -> None:
    assert command("replay", log("x.log", [Fault()]), "virtual:x") == (
        2, "", "tailbyte: x.log: no frame that could be sent\n"
    )  # fmt: skip


def test_what_no_program_can_send(command: Command, receiver: can.BusABC, real: list[dict[str, Any]]) -> None:
    status, _, err = command("replay", CAPTURES / "faults.log", "virtual:here")
    assert (status, len(got(receiver))) == (3, 1966)
    assert err.splitlines()[-1] == (
        "-- not sent: error frames, which only a controller makes (2); frames that the recording has lost (3)"
    )
    assert " line 1607: " in err
    assert len(real) == 1
