"""`tailbyte simulate` on SocketCAN."""

from __future__ import annotations

import json
import subprocess
import threading
from typing import TYPE_CHECKING

import pytest
from socketcan.kernel import Recorder, SlcanAdapter, ip, route

from analyzer.live.interfaces.links import Link, list_gateways, list_links
from analyzer.live.replay.safety import find_doubt

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    Command = Callable[..., tuple[int, str, str]]

SETTINGS = ("--duration", "1", "--fault", "TRF-003@0.4", "--seed", "7")
EXTENDED = 0x8000_0000


@pytest.fixture
def adapter() -> Iterator[SlcanAdapter]:
    made = SlcanAdapter(500_000)
    yield made
    made.unplug()


def named() -> dict[str, Link]:
    return {link.name: link for link in list_links()}


def of_file(path: Path) -> list[tuple[int, bytes]]:
    found = []
    for line in path.read_text().splitlines():
        number, _, data = line.split()[2].partition("#")
        found.append((int(number, 16) | (EXTENDED if len(number) == 8 else 0), bytes.fromhex(data)))
    return found


def test_what_arrives_is_what_a_file_holds(command: Command, tmp_path: Path) -> None:
    recorder = Recorder("vcan0")
    status, out, err = command("simulate", "vcan0", *SETTINGS, "--key", tmp_path / "bus.json")
    assert (status, out) == (0, ""), err
    assert err.endswith(", 1.0 s, 1 fault sent on vcan0\n")
    assert command("simulate", "-o", tmp_path / "file.log", *SETTINGS, "--key", tmp_path / "file.json")[0] == 0
    got, dropped = recorder.all(), recorder.dropped
    recorder.close()
    assert dropped == 0
    assert len(got) > 100
    assert got == of_file(tmp_path / "file.log")
    faults = [json.loads((tmp_path / name).read_text())["faults"] for name in ("bus.json", "file.json")]
    assert faults[0][0].pop("t_ns") != faults[1][0].pop("t_ns")
    assert faults[0][0].pop("t_end_ns") != faults[1][0].pop("t_end_ns")
    assert faults[0] == faults[1]


def test_the_kernel_says_what_is_virtual(adapter: SlcanAdapter) -> None:
    found = named()
    assert {name: link.kind for name, link in found.items()} == {
        "vcan0": "vcan", "vcan1": "vcan", "vxcan0": "vxcan", "vxcan1": "vxcan", adapter.channel: "can",
    }  # fmt: skip
    assert found["vxcan0"].peer == found["vxcan1"].index
    assert found[adapter.channel].bit_rate == 500_000
    assert found["vcan0"].bit_rate is None
    assert [found[name].fd for name in ("vcan0", "vcan1")] == [True, False]
    assert [find_doubt("socketcan", name, {}) for name in ("vcan0", "vcan1", "vxcan0", "vxcan1")] == [""] * 4
    assert find_doubt("socketcan", adapter.channel, {}) == "the kernel calls it can, not vcan"


def test_a_name_proves_nothing(command: Command, adapter: SlcanAdapter) -> None:
    ip("set", adapter.channel, "down")
    ip("set", adapter.channel, "name", "vcan9")
    ip("set", "vcan9", "up")
    status, _, err = command("simulate", "vcan9", "--duration", "1")
    assert status == 2
    assert err.startswith("tailbyte simulate: vcan9 may be real: the kernel calls it can, not vcan;")
    assert " RawCommand " in err
    assert not any(line.startswith(b"T") for line in adapter.written.split(b"\r"))


def test_it_is_sent_if_that_is_wanted(command: Command, adapter: SlcanAdapter, tmp_path: Path) -> None:
    """At the bit rate of the controller, which the kernel knows."""
    wanted = ("--duration", "0.3", "--allow-actuation", "--key", tmp_path / "key.json")
    status, _, err = command("simulate", adapter.channel, *wanted)
    assert status == 0, err
    key = json.loads((tmp_path / "key.json").read_text())
    assert key["settings"]["bit_rate"] == 500_000
    ip("set", adapter.channel, "down")  # everything has been written then
    sent = [line for line in adapter.written.split(b"\r") if line.startswith(b"T")]
    assert 0 < len(sent) <= key["capture"]["frames"]


def test_what_a_gateway_passes_on_is_not_virtual_any_more(adapter: SlcanAdapter) -> None:
    ip("add", "vcan5", "type", "vcan")
    route("vcan5", "vxcan0")
    assert list_gateways()
    assert find_doubt("socketcan", "vcan5", {}) == ""
    route("vxcan1", adapter.channel)
    said = f"its frames go on to {adapter.channel}: the kernel calls it can, not vcan"
    assert find_doubt("socketcan", "vcan5", {}) == said
    assert find_doubt("socketcan", "vcan0", {}) == ""
    ip("del", "vcan5")


def test_the_other_end_may_be_out_of_sight() -> None:
    ip("add", "inside", "type", "vxcan", "peer", "name", "outside")
    with subprocess.Popen(["unshare", "-n", "sh", "-c", "echo; read x"], stdin=-1, stdout=-1) as elsewhere:
        assert elsewhere.stdout is not None
        elsewhere.stdout.readline()
        ip("set", "outside", "netns", str(elsewhere.pid))
        assert "out of sight" in find_doubt("socketcan", "inside", {})
        elsewhere.communicate(b"\n")


def test_an_interface_that_is_missing_or_down(command: Command) -> None:
    names = ", ".join(named())
    said = f"tailbyte: vcan8: no such interface (there is {names})\n"
    assert command("simulate", "vcan8") == (3, "", said)
    ip("set", "vcan1", "down")
    try:
        assert command("simulate", "vcan1") == (3, "", "tailbyte: vcan1: is down (ip link set vcan1 up)\n")
    finally:
        ip("set", "vcan1", "up")


def test_an_interface_that_goes_away(command: Command, tmp_path: Path) -> None:
    ip("add", "vcan6", "type", "vcan")
    ip("set", "vcan6", "up")
    recorder = Recorder("vcan6")

    def remove() -> None:
        recorder.first()
        ip("del", "vcan6")

    remover = threading.Thread(target=remove)
    remover.start()
    key = tmp_path / "key.json"
    status, _, err = command("simulate", "vcan6", "--key", key)
    remover.join()
    recorder.close()
    told, reason = err.splitlines()
    assert (status, reason) == (3, "tailbyte: vcan6: has been removed")
    assert told.startswith(f"-- {json.loads(key.read_text())['capture']['frames']:,} frames, ")


def test_frames_of_can_fd_need_an_interface_for_them(command: Command, tmp_path: Path) -> None:
    """On a classic one there is no occasion for them."""
    key = tmp_path / "key.json"
    for name, frames in (("vcan0", 1), ("vcan1", 0)):
        wanted = ("--duration", "1", "--fault", "CAN-003", "--key", key)
        status, _, err = command("simulate", name, *wanted)
        assert (status, "\n-- not sent: CAN FD frames (" in err) == (0 if frames else 2, not frames), err
        assert len(json.loads(key.read_text())["faults"]) == frames
