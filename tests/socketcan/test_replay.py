"""`tailbyte replay` on SocketCAN."""

from __future__ import annotations

import subprocess
import sys
import threading
from typing import TYPE_CHECKING, TypeVar

import can
import pytest
from kit.command import CAPTURES, HOVER, start, wait_until
from kit.live import got
from kit.rows import EXTENDED, FD, Frame, piece, records, text
from socketcan.kernel import Recorder, SlcanAdapter, ip, route

from analyzer.sinks import open_sink

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    Command = Callable[..., tuple[int, str, str]]

T = TypeVar("T")

SECOND = 10**9
LONG = 1 << 31
GROUP = "239.74.163.2"
# Prints every frame, up to the one that says that it was the last.
LISTENER = """
import can, sys
with can.Bus(sys.argv[1], interface="udp_multicast", ignore_config=True) as bus:
    print("ready", flush=True)
    for message in iter(bus.recv, None):
        if not message.is_extended_id:
            break
        print(f"{message.arbitration_id:08X}#{message.data.hex()}")
"""


@pytest.fixture
def adapter() -> Iterator[SlcanAdapter]:
    made = SlcanAdapter(500_000)
    yield made
    made.unplug()


def frames(capture: Path) -> list[Frame]:
    return [frame for frame in records(text(capture.read_bytes())) if isinstance(frame, Frame)]


def words(found: list[Frame]) -> list[tuple[int, bytes]]:
    """As the kernel's own recorder has them."""
    return [(frame.id | (LONG if frame.flags & EXTENDED else 0), frame.data) for frame in found]


def arrived(take: Callable[[], list[T]], count: int) -> list[T]:
    """So many frames, and whatever else there is then: the kernel may deliver them a little later."""
    found: list[T] = []
    wait_until(lambda: found.extend(take()) is None and len(found) >= count)
    return found


def written(adapter: SlcanAdapter) -> list[bytes]:
    """The frames that the kernel has given to it."""
    return [line for line in bytes(adapter.written).split(b"\r")[:-1] if line.startswith(b"T")]


def log(path: Path, found: list[Frame]) -> Path:
    with path.open("wb") as file:
        sink = open_sink("candump", file)
        sink.write(piece(found))
        sink.close()
    return path


def test_what_arrives_is_what_the_capture_holds(command: Command) -> None:
    for options in ((), ("--speed", "max")):
        recorder = Recorder("vcan0")
        status, out, err = command("replay", HOVER, "vcan0", *options)
        assert (status, out) == (0, ""), err
        assert err.startswith("-- 1,868 frames, 2.0 s sent on vcan0; ")
        assert arrived(recorder.all, 1868) == words(frames(HOVER))
        assert recorder.dropped == 0
        recorder.close()


def test_maps(command: Command, tmp_path: Path) -> None:
    first, second = (Frame(SECOND * 10**9 + k, f"can{k}", 0x100 + k, 0, bytes([k])) for k in range(2))
    capture = log(tmp_path / "x.log", [first, second])
    recorders = [Recorder(name) for name in ("vcan0", "vcan1")]
    assert command("replay", capture, "vcan0=can1", "vcan1=can0")[0] == 0
    assert [arrived(recorder.all, 1) for recorder in recorders] == [words([second]), words([first])]
    for recorder in recorders:
        recorder.close()


def test_can_fd_goes_where_it_is_taken(command: Command, tmp_path: Path) -> None:
    found = [Frame(SECOND * 10**9 + k, "can0", k, flags, bytes(12 if flags else 8)) for k, flags in enumerate((FD, 0))]
    capture = log(tmp_path / "x.log", found)
    for name, left_out in (("vcan0", ""), ("vcan1", "-- not sent: CAN FD frames (1)\n")):
        with can.Bus(name, interface="socketcan", fd=True, ignore_config=True) as bus:
            status, _, err = command("replay", capture, name)
            assert (status, err.partition("\n")[2]) == (0, left_out)
            count = 2 - bool(left_out)
            assert len(arrived(lambda: got(bus), count)) == count


def test_a_name_proves_nothing(command: Command, adapter: SlcanAdapter) -> None:
    """What the kernel calls can is real, and gets no commands; all the rest it may have."""
    ip("set", adapter.channel, "down")
    ip("set", adapter.channel, "name", "vcan9")
    ip("set", "vcan9", "up")
    status, _, err = command("replay", HOVER, "vcan9")
    assert (status, " RawCommand " in err) == (2, True)
    assert err.startswith("tailbyte replay: vcan9 may be real: the kernel calls it can, not vcan;")
    assert command("replay", HOVER, "vcan9", "--frames", "1-20", "-f", "1F040A0B:1FFFFFFF")[0] == 0
    wait_until(lambda: bool(written(adapter)))
    ip("set", "vcan9", "down")
    assert {line[1:9] for line in written(adapter)} == {b"1F040A0B"}


def test_a_route_that_comes_up_ends_it(command: Command, adapter: SlcanAdapter) -> None:
    """Nothing real was behind the interface when it began."""
    ip("add", "vcan7", "type", "vcan")
    ip("set", "vcan7", "up")
    recorder = Recorder("vcan7")

    def lead_on() -> None:
        recorder.first()
        route("vcan7", adapter.channel)

    thread = threading.Thread(target=lead_on)
    thread.start()
    status, _, err = command("replay", HOVER, "vcan7", "--loop", "inf")
    thread.join()
    recorder.close()
    ip("del", "vcan7")
    why = f"its frames go on to {adapter.channel}: the kernel calls it can, not vcan"
    assert status == 2
    assert f"not sent on vcan7, which may be real now ({why}), without --allow-actuation" in err


def test_as_fast_as_a_controller_takes_it(command: Command, adapter: SlcanAdapter) -> None:
    """Its transmit queue has room for ten frames; it is waited for."""
    status, _, err = command("replay", HOVER, adapter.channel, "--speed", "max", "--allow-actuation")
    assert (status, err[:16]) == (0, "-- 1,868 frames,")
    wait_until(lambda: len(written(adapter)) >= 1868)
    assert [int(line[1:9], 16) for line in written(adapter)] == [frame.id for frame in frames(HOVER)]


def test_an_interface_that_is_missing_or_down(command: Command) -> None:
    status, _, err = command("replay", HOVER, "vcan8")
    assert (status, err.startswith("tailbyte: vcan8: no such interface (there is ")) == (3, True)
    ip("set", "vcan1", "down")
    try:
        status, _, err = command("replay", HOVER, "vcan1")
    finally:
        ip("set", "vcan1", "up")
    assert (status, err.splitlines()[-1]) == (3, "tailbyte: vcan1: is down (ip link set vcan1 up)")


def test_an_interface_that_goes_away(command: Command) -> None:
    ip("add", "vcan7", "type", "vcan")
    ip("set", "vcan7", "up")
    recorder = Recorder("vcan7")

    def remove() -> None:
        recorder.first()
        ip("del", "vcan7")

    remover = threading.Thread(target=remove)
    remover.start()
    status, _, err = command("replay", HOVER, "vcan7", "--loop", "inf")
    remover.join()
    recorder.close()
    assert (status, err.splitlines()[-1]) == (3, "tailbyte: vcan7: has been removed")
    assert err.startswith("-- ")


def test_between_two_processes_without_any_can_interface() -> None:
    """Over a multicast group that never leaves this machine; one without a network needs a route."""
    capture, window = CAPTURES / "hover-4.log", ("--frames", "1-200")  # as many as wait in a socket at least
    with start("replay", capture, f"udp_multicast:{GROUP}", stderr=-1) as alone:
        assert alone.stderr is not None
        assert b"without a network it takes a route" in alone.stderr.read()
    assert alone.returncode == 3
    subprocess.run(["ip", "route", "add", "239.0.0.0/8", "dev", "lo"], check=True)
    with subprocess.Popen([sys.executable, "-c", LISTENER, GROUP], stdout=-1) as listener:
        assert listener.stdout is not None
        assert listener.stdout.readline() == b"ready\n"
        with start("replay", capture, f"udp_multicast:{GROUP}", *window, stderr=-1) as replay:
            assert replay.stderr is not None
            assert b" sent on udp_multicast:239.74.163.2; " in replay.stderr.read()
        with can.Bus(GROUP, interface="udp_multicast", ignore_config=True) as bus:
            bus.send(can.Message(is_extended_id=False))
        lines = listener.stdout.read().decode().splitlines()
    assert (replay.returncode, listener.returncode) == (0, 0)
    assert lines == [f"{frame.id:08X}#{frame.data.hex()}" for frame in frames(capture)[:200]]
