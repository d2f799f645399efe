"""`tailbyte replay` lets nothing reach a bus that may be real, unless that is wanted."""

from __future__ import annotations

import re
import socket
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from kit.command import HOVER
from kit.judged import registry
from kit.live import Failing, got
from kit.rows import EXTENDED, REMOTE, Frame
from kit.waiting import RAW, START, STATUS, Clock, frames, log, replays_wait_by, standard_input

from analyzer.app import reel as replay_reel
from analyzer.live.interfaces import links
from analyzer.live.interfaces.naming import Interface
from analyzer.live.replay import outlet as outlet_module
from analyzer.live.replay.outlet import AGAIN, ActuationError, Outlet
from analyzer.live.replay.player import ReplayFrame
from analyzer.live.replay.safety import Guard

if TYPE_CHECKING:
    from collections.abc import Callable

    import can

    Command = Callable[..., tuple[int, str, str]]

pytestmark = pytest.mark.usefixtures("no_can_configuration", "clock")


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    return replays_wait_by(Clock(), monkeypatch)


def test_commands_are_kept_from_what_may_be_real(
    command: Command, receiver: can.BusABC, real: list[dict[str, Any]]
) -> None:
    status, out, err = command("replay", HOVER, "slcan:/dev/ttyACM0@500000")
    assert (status, out, real, got(receiver)) == (2, "", [], [])
    lines = err.splitlines()
    assert lines[0] == (
        "tailbyte replay: slcan:/dev/ttyACM0 may be real: slcan is no virtual interface; this would be sent:"
    )
    assert [line.split() for line in lines[1:5]] == [
        ["Node", "Type", "Frames", "Hz"], ["1", "RawCommand", "800", "400.5"], ["126", "PUSHSCI", "13", "6.5"],
        ["126", "ParamCfg", "5", "2.5"],
    ]  # fmt: skip
    assert lines[5:] == ["-- nothing was sent; --allow-actuation sends it: motors have propellers"]
    assert " RawCommand       800     801.0\n" in command("replay", HOVER, "slcan:x", "--speed", "2")[2]


def test_they_are_sent_if_that_is_wanted(command: Command, receiver: can.BusABC, real: list[dict[str, Any]]) -> None:
    assert command("replay", HOVER, "slcan:x", "--allow-actuation")[0] == 0
    assert (len(real), len(got(receiver))) == (1, 1868)


def test_what_moves_nothing_is_sent_anywhere(
    command: Command, receiver: can.BusABC, real: list[dict[str, Any]]
) -> None:
    """The window, the filters and the maps count: only what would be sent there is in the way."""
    capture = log("x.log", [*frames(RAW), *frames(STATUS, STATUS), *frames(RAW, bus="can1")])
    assert command("replay", capture, "slcan:x=can0")[0] == 2
    assert real == []
    for options in (("--frames", "2-3"), ("--frames", "2-4"), ("-f", f"{STATUS:08X}:1FFFFFFF")):
        assert command("replay", capture, "slcan:x=can0", *options)[0] == 0
        assert [number for number, *_ in got(receiver)] == [STATUS, STATUS]
    asked = Frame(START, "can0", RAW, EXTENDED | REMOTE)
    assert command("replay", log("y.log", [asked]), "slcan:x")[0] == 0
    assert got(receiver) == [(RAW, True, True, b"")]
    status, _, err = command("replay", capture, "virtual:here=can1", "slcan:x=can0")
    assert (status, err.count("may be real"), got(receiver)) == (2, 1, [])


def test_what_nobody_knows_may_move_something(
    command: Command, receiver: can.BusABC, real: list[dict[str, Any]]
) -> None:
    for found in (frames(0x0A03E701), frames(0x123, flags=0)):
        status, _, err = command("replay", log("x.log", found), "slcan:x")
        assert (status, " 1         -\n" in err, real, got(receiver)) == (2, True, [], [])


def test_what_cannot_be_looked_through_is_refused(
    command: Command, receiver: can.BusABC, real: list[dict[str, Any]]
) -> None:
    """A pipe is read once: what it would actuate is known when half of it has been sent."""
    for found in (frames(STATUS, STATUS, RAW, STATUS), frames(STATUS)):
        with standard_input() as pipe:
            pipe.write(Path(log("x.log", found)).read_bytes())
            pipe.close()
            status, _, err = command("replay", "-", "slcan:x")
        assert (status, real, got(receiver)) == (2, [], [])
        assert err.startswith(
            "tailbyte replay: slcan:x may be real: slcan is no virtual interface; "
            "a pipe cannot be looked through first\n-- nothing was sent; --allow-actuation sends it"
        )
    with standard_input() as pipe:
        pipe.write(Path(log("x.log", frames(STATUS, RAW))).read_bytes())
        pipe.close()
        assert command("replay", "-", "slcan:x", "--allow-actuation")[0] == 0
    assert [number for number, *_ in got(receiver)] == [STATUS, RAW]


@pytest.mark.parametrize(
    ("routes", "name", "why"),
    [
        ([(1, 2)], "vcan0", "its frames go on to can7: the kernel calls it can, not vcan"),
        ([], "vcan9", "it is called vcan9 by now"),
    ],
    ids=["routed", "renamed"],
)
def test_a_bus_that_becomes_real_gets_no_command(
    routes: list[tuple[int, int]], name: str, why: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A route of the gateway, or another name, that comes up in the midst of sending; no later than `AGAIN`."""
    now, names, rules = [0.0], {1: "vcan0"}, list[tuple[int, int]]()
    known = [links.Link(1, "vcan0", "vcan", up=True), links.Link(2, "can7", "can", up=True)]
    monkeypatch.setattr(links, "list_links", lambda: known)
    monkeypatch.setattr(links, "list_gateways", lambda: rules)
    monkeypatch.setattr(socket, "if_nametoindex", lambda _: 1)
    monkeypatch.setattr(socket, "if_indextoname", names.__getitem__)
    monkeypatch.setattr(outlet_module, "open_bus", lambda _: Failing(10, RuntimeError()))
    flags = {"extended": True, "remote": False, "fd": False, "brs": False, "esi": False}
    raw, status = (ReplayFrame(0, 0, number, bytes(8), dlc=8, **flags) for number in (RAW, STATUS))  # type: ignore[arg-type]
    with Outlet(Interface("socketcan", "vcan0"), Guard(registry()), lambda: now[0]) as outlet:
        assert outlet.send(raw)
        rules += routes
        names[1] = name
        now[0] += AGAIN / 2
        assert outlet.send(raw)
        now[0] += AGAIN / 2
        assert outlet.send(status)
        with pytest.raises(ActuationError, match=re.escape(f"not sent on vcan0, which may be real now ({why})")):
            outlet.send(raw)
        assert outlet.sent == 3


@pytest.mark.usefixtures("real")
def test_a_real_interface_of_the_kernel(command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    known = [links.Link(1, "vcan0", "can", up=True), links.Link(2, "can0", "vcan", up=True)]
    monkeypatch.setattr(links, "list_links", lambda: known)
    monkeypatch.setattr(links, "list_gateways", list)
    status, _, err = command("replay", HOVER, "vcan0")
    assert (status, "vcan0 may be real: the kernel calls it can, not vcan" in err) == (2, True)
    assert command("replay", HOVER, "can0")[0] == 0


@pytest.mark.slow
def test_long_captures_are_not_kept(
    command: Command, receiver: can.BusABC, real: list[dict[str, Any]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """They are sent as they are read; looked through only where that is needed."""
    monkeypatch.setattr(replay_reel, "MOST_HELD", 30_000)
    capture = log("x.log", frames(*[STATUS] * 69_999, RAW, step=100))
    for loops in (1, 2):
        status, _, err = command("replay", capture, "virtual:here", "--speed", "max", "--loop", loops)
        assert (status, err.endswith("; 70000 lines = 70000 frames\n")) == (0, True)
        assert len(got(receiver)) == 70_000 * loops
    status, _, err = command("replay", capture, "slcan:x", "--speed", "max")
    assert (status, "RawCommand         1     142.9\n" in err, got(receiver)) == (2, True, [])
    assert len(real) == 2
    assert command("replay", capture, "slcan:x", "--speed", "max", "--allow-actuation")[0] == 0
    assert len(got(receiver)) == 70_000
    status, _, err = command("replay", capture, "slcan:x", "--speed", "max", "--frames", "-69999")
    assert (status, err.endswith("; 70000 lines = 70000 frames\n")) == (0, True)
    assert len(got(receiver)) == 69_999
