"""`tailbyte simulate` onto a bus: what arrives is what a file would hold, and nothing arrives that must not."""

from __future__ import annotations

import errno
import json
import os
import signal
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Any

import can
import pytest
from kit.live import Failing, got

import dissectors
from analyzer.cli.simulate import bus as simulate_bus
from analyzer.live.interfaces import links
from dissectors.traffic import SimulatedFrame

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from analyzer.simulate import SimulationSettings

    Command = Callable[..., tuple[int, str, str]]

pytestmark = pytest.mark.usefixtures("no_can_configuration")

SETTINGS = ("--duration", "700ms", "--esc", "2", "--seed", "3", "--fault", "TRF-003@0.4")


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def held(path: str) -> list[tuple[int, bool, bool, bytes]]:
    """What a capture holds, error frames and a second interface left out."""
    found = []
    for line in Path(path).read_text().splitlines():
        _, bus, frame = line.split()
        number, _, data = frame.partition("#")
        if bus == "can0" and not int(number, 16) >> 29:
            remote = data.startswith("R")
            found.append((int(number, 16), len(number) == 8, remote, b"" if remote else bytes.fromhex(data)))
    return found


def without_time(fault: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in fault.items() if name not in ("t_ns", "t_end_ns")}


@pytest.mark.slow
@pytest.mark.parametrize(
    "way", [["virtual:here"], ["-i", "virtual:here"], ["--interface", "virtual", "--channel", "here"]]
)
def test_what_arrives_is_what_a_file_holds(command: Command, receiver: can.BusABC, way: list[str]) -> None:
    status, out, err = command("simulate", *way, *SETTINGS, "--key", "bus.json")
    arrived = got(receiver)
    assert (status, out, err) == (0, "", f"-- {len(arrived):,} frames, 0.7 s, 1 fault sent on virtual:here\n")
    assert command("simulate", "-o", "file.log", "--key", "file.json", *SETTINGS)[0] == 0
    assert len(arrived) > 50
    assert arrived == held("file.log")
    of_bus, of_file = (json.loads(Path(name).read_text()) for name in ("bus.json", "file.json"))
    assert [*map(without_time, of_bus["faults"])] == [*map(without_time, of_file["faults"])]
    assert of_bus["capture"]["bus"] == "here"
    start = of_bus["settings"]["start_ns"]
    assert of_bus["faults"][0]["t_ns"] - start == of_file["faults"][0]["t_ns"] - of_file["settings"]["start_ns"]


@pytest.mark.slow
def test_frames_are_let_through_by_the_clock(
    command: Command, receiver: can.BusABC, monkeypatch: pytest.MonkeyPatch
) -> None:
    """None before its time, as the receiver's own clock shows."""
    seen: list[int] = []
    over = simulate_bus.Pacer.over

    def watched(self: simulate_bus.Pacer, frames: Iterator[SimulatedFrame]) -> Iterator[SimulatedFrame]:
        start = self._clock()
        for frame in over(self, frames):
            assert self._clock() - start >= frame.t
            seen.append(frame.t)
            yield frame

    monkeypatch.setattr(simulate_bus.Pacer, "over", watched)
    assert command("simulate", "virtual:here", *SETTINGS)[0] == 0
    assert seen == sorted(seen)
    assert len(seen) == len(got(receiver))


@pytest.mark.slow
def test_what_no_program_can_send(command: Command, receiver: can.BusABC, monkeypatch: pytest.MonkeyPatch) -> None:
    """Error frames and a second interface are left out, and are no part of the key."""
    frames = simulate_bus.Simulation.frames

    def more(self: simulate_bus.Simulation, pace: Any) -> Iterator[SimulatedFrame]:
        def also(regular: Iterator[SimulatedFrame]) -> Iterator[SimulatedFrame]:
            for number, frame in enumerate(regular):
                yield frame
                if number < 3:
                    yield SimulatedFrame(4, bytes(8), error=True, t=frame.t)
                if number < 2:
                    yield SimulatedFrame(5, b"x", bus=1, t=frame.t)
                if number == 9:
                    yield SimulatedFrame(6, bytes(12), fd=True, brs=True, t=frame.t)
                    yield SimulatedFrame(0x7FF, b"", extended=False, remote=True, dlc=5, t=frame.t)

        return frames(self, lambda regular: pace(also(regular)))

    monkeypatch.setattr(simulate_bus.Simulation, "frames", more)
    status, _, err = command("simulate", "virtual:here", *SETTINGS, "--key", "key.json")
    assert (status, err.splitlines()[1]) == (
        0, "-- not sent: error frames, which only a controller makes (3); frames of the second interface (2)",
    )  # fmt: skip
    arrived = got(receiver)
    assert (6, True, False, bytes(12)) in arrived
    assert (0x7FF, False, True, b"") in arrived
    capture = json.loads(Path("key.json").read_text())["capture"]
    assert (capture["frames"], capture["error_frames"]) == (len(arrived), 0)


def test_ctrl_c_ends_an_endless_run(command: Command, receiver: can.BusABC) -> None:
    """The key is about what has been sent."""

    def interrupt() -> None:
        for _ in range(200):
            assert receiver.recv(30) is not None
        os.kill(os.getpid(), signal.SIGINT)

    reader = threading.Thread(target=interrupt)
    reader.start()
    status, out, err = command("simulate", "virtual:here", "--key", "key.json", "--fault", "TRF-003@23h")
    reader.join()
    key = json.loads(Path("key.json").read_text())
    frames = 200 + len(got(receiver))
    assert (status, out) == (130, "")
    assert err.startswith(f"-- {frames:,} frames, ")
    assert err.endswith(" 0 faults sent on virtual:here\n-- not happened yet: TRF-003@23h\n")
    assert key["capture"]["frames"] == frames
    assert key["settings"]["duration_ns"] == 86_400 * 10**9


def test_faults_of_an_endless_run_come_soon(command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where they would come in the ten seconds of a file."""
    wanted: list[SimulationSettings] = []
    monkeypatch.setattr(simulate_bus, "run", lambda settings, *_, **__: wanted.append(settings) or 0)
    assert command("simulate", "virtual:here", "--fault", "TRF-003")[0] == 0
    assert wanted[0].duration == 86_400 * 10**9
    simulation = simulate_bus.Simulation(wanted[0], dissectors.load())
    for frame in simulation.frames():
        if frame.answers or (frame.sending is not None and frame.sending.answers):
            break
        assert frame.t < 10 * 10**9
    assert frame.t > 3 * 10**9


def test_a_fault_that_found_no_occasion(command: Command, receiver: can.BusABC) -> None:
    status, _, err = command("simulate", "virtual:here", "--duration", "300ms", "--fault", "TRF-003@0.2:node=99")
    assert (status, err.splitlines()[1]) == (2, "tailbyte simulate: no occasion in 0.3 s for TRF-003@0.2:node=99")
    assert got(receiver)


@pytest.mark.slow
def test_commands_are_kept_from_what_may_be_real(
    command: Command, receiver: can.BusABC, real: list[dict[str, Any]]
) -> None:
    Path("key.json").write_text("old")
    status, out, err = command("simulate", "slcan:/dev/ttyACM0@500000", "--key", "key.json")
    lines = err.splitlines()
    assert (status, out, real, got(receiver)) == (2, "", [], [])
    assert lines[0] == (
        "tailbyte simulate: slcan:/dev/ttyACM0 may be real: slcan is no virtual interface; this would be sent:"
    )
    assert lines[1].split() == ["Node", "Type", "Frames", "Hz"]
    rows = {row[1]: row for row in map(str.split, lines[2:-1])}
    assert rows.keys() >= {"RawCommand", "ParamCfg"}
    assert 100 < float(rows["RawCommand"][3]) <= 400
    assert lines[-1] == "-- nothing was sent; --allow-actuation sends it: motors have propellers"
    assert Path("key.json").read_text() == "old"


def test_they_are_sent_if_that_is_wanted(command: Command, receiver: can.BusABC, real: list[dict[str, Any]]) -> None:
    status, _, err = command("simulate", "slcan:x@500000", "--duration", "500ms", "--allow-actuation")
    assert (status, " sent on slcan:x\n" in err) == (0, True)
    assert real == [{"interface": "slcan", "ignore_config": True, "channel": "x", "bitrate": 500_000}]
    assert any(number >> 8 & 0xFFFF == 1030 for number, *_ in got(receiver))


def test_a_command_that_comes_late_is_stopped(
    command: Command, receiver: can.BusABC, real: list[dict[str, Any]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Only the beginning is looked at before; the rest is watched while it is sent."""
    monkeypatch.setattr(simulate_bus, "_AHEAD", 0)
    status, _, err = command("simulate", "slcan:x", "--key", "key.json", "--duration", "10")
    arrived = got(receiver)
    assert (status, err.count("\n"), len(real)) == (2, 2, 1)
    assert json.loads(Path("key.json").read_text())["capture"]["frames"] == len(arrived)
    assert " after the start: not sent on slcan:x, which may be real, without --allow-actuation" in err
    assert arrived
    assert not any(number >> 8 & 0xFFFF in (1030, 1033, 1038) for number, *_ in arrived)


@pytest.mark.slow
@pytest.mark.usefixtures("real")
def test_a_real_interface_of_the_kernel(command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    known = [links.Link(1, "vcan0", "can", up=True, bit_rate=250_000), links.Link(2, "can0", "vcan", up=True)]
    monkeypatch.setattr(links, "list_links", lambda: known)
    monkeypatch.setattr(links, "list_gateways", list)
    status, _, err = command("simulate", "vcan0", "--duration", "300ms")
    assert (status, "vcan0 may be real: the kernel calls it can, not vcan" in err) == (2, True)
    assert command("simulate", "can0", "--duration", "300ms", "--key", "key.json")[0] == 0
    assert json.loads(Path("key.json").read_text())["settings"]["bit_rate"] == 1_000_000
    assert command("simulate", "vcan0", "--duration", "300ms", "--key", "key.json", "--allow-actuation")[0] == 0
    assert json.loads(Path("key.json").read_text())["settings"]["bit_rate"] == 250_000


def test_a_bus_that_cannot_be_opened(command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    status, out, err = command("simulate", "no-such-can")  # whatever this machine has
    assert (status, out, err.count("\n")) == (3, "", 1)
    assert err.startswith("tailbyte: no-such-can: ")

    def fail(**_: object) -> None:
        raise OSError(errno.EAFNOSUPPORT, "Address family not supported by protocol")

    monkeypatch.setattr(can, "Bus", fail)
    monkeypatch.setattr(links, "list_links", list)
    assert command("simulate", "vcan0") == (3, "", "tailbyte: vcan0: this system has no SocketCAN\n")


def test_a_bus_that_fails(command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its own failure is told, not that of closing it."""
    failing = Failing(20, can.CanOperationError("Failed to transmit: Network is down", errno.ENETDOWN))
    monkeypatch.setattr(can, "Bus", lambda **_: failing)
    said = "-- 20 frames, 0.0 s, 0 faults sent on virtual:x\ntailbyte: virtual:x: is down\n"
    assert command("simulate", "virtual:x", "--key", "key.json") == (3, "", said)
    assert json.loads(Path("key.json").read_text())["capture"]["frames"] == failing.sent == 20


def test_a_key_that_cannot_be_written_is_known_before_anything_is_sent(command: Command, receiver: can.BusABC) -> None:
    status, _, err = command("simulate", "virtual:here", "--key", "no/key.json")
    assert (status, err, got(receiver)) == (3, "tailbyte: no/key.json: there is no folder no\n", [])


@pytest.mark.parametrize(
    ("args", "reason"),
    [
        (["vcan0", "-i", "vcan1"], "vcan0 and -i vcan1: which one?"),
        (["virtual:x@500000", "--bitrate", "125000"], "virtual:x@500000 and --bitrate 125000 contradict each other"),
        (["virtual:x@800000"], "--bitrate 800000 is none of 1000000, 500000, 250000, 125000, 100000, 50000"),
        (["vitrual:x"], "vitrual:x: no interface type is called 'vitrual' (near: virtual)"),
        (["virtual:x", "--bus-kwargs", "y"],
         "--bus-kwargs: 'y' is not key=value (what does not belong to it goes in front of it)"),
    ],
)  # fmt: skip
def test_what_is_refused(command: Command, args: list[str], reason: str) -> None:
    assert command("simulate", *args) == (2, "", f"tailbyte simulate: {reason}\n")


@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP"])
def test_whoever_ends_it_gets_the_key(name: str, command: Command, receiver: can.BusABC) -> None:
    """What was sent has been sent, however it ended."""

    def end() -> None:
        for _ in range(20):
            assert receiver.recv(30) is not None
        os.kill(os.getpid(), signal.Signals[name])

    reader = threading.Thread(target=end)
    reader.start()
    status, _, err = command("simulate", "virtual:here", "--key", "key.json")
    reader.join()
    frames = 20 + len(got(receiver))
    assert status == 128 + signal.Signals[name]
    assert err.startswith(f"-- {frames:,} frames, ")
    assert json.loads(Path("key.json").read_text())["capture"]["frames"] == frames
