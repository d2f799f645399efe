"""The interfaces that there are: what the kernel and python-can say of them, and how it reads in 80 columns."""

from __future__ import annotations

import os
import subprocess
import sys
import warnings
from typing import TYPE_CHECKING, Any

import can
import pytest
from kit.command import LIMIT, environment

from analyzer.live.interfaces import links, listing
from analyzer.live.interfaces.links import Controller, Link, Timing, Traffic
from analyzer.live.interfaces.listing import ListedInterface
from analyzer.live.interfaces.table import render
from analyzer.views.terminal import Palette

if TYPE_CHECKING:
    from collections.abc import Sequence

CAN0 = Link(
    3, "can0", "can", up=True, fd=True, bit_rate=500_000, mtu=72, queue=10,
    controller=Controller(
        "error passive", Timing(500_000, 875), Timing(2_000_000, 750), restart_ms=100, modes=("listen only", "fd"),
        tx_errors=130, rx_errors=7, bus_errors=1234, bus_offs=1,
    ),
    traffic=Traffic(1_234_567, 89, 3, 4),
)  # fmt: skip
CAN1 = Link(4, "can1", "can", controller=Controller("stopped"))
CAN2 = Link(5, "can2", "can", up=True, controller=Controller("error active", Timing(83_333)))
VCAN0 = Link(2, "vcan0", "vcan", up=True, fd=True, queue=1000, traffic=Traffic(0, 0, 0, 0))


def table(*found: Link | str, width: int = 80) -> str:
    return render(
        [ListedInterface(one) if isinstance(one, str) else ListedInterface(one.name, one) for one in found], width
    )


def test_the_table() -> None:
    assert table(CAN0, CAN1, CAN2, VCAN0, "pcan:PCAN_USBBUS1") == (
        "Interface  Kind  State          Bit rate    Data rate  Restart  Frames\n"
        "can0       can   error passive  500k 87.5%  2M 75.0%   100 ms   FD\n"
        "           modes: listen only\n"
        "           error counters: transmit 130, receive 7\n"
        "           bus errors: 1,234; bus off: 1; restarts: 0\n"
        "           1,234,567 frames received, 89 sent, 7 dropped; transmit queue 10\n"
        "can1       can   down           -           -          never    classic\n"
        "can2       can   error active   83.333k     -          never    classic\n"
        "vcan0      vcan  up             -           -          -        FD\n"
        "           0 frames received, 0 sent, 0 dropped; transmit queue 1000\n"
        "Found by python-can:\n"
        "  pcan:PCAN_USBBUS1\n"
    )


def test_every_line_fits() -> None:
    long = Link(1, "a_name_of_15_ch", "can", up=True, controller=Controller("error passive", Timing(1_000_000, 875)))
    assert max(map(len, table(CAN0, long, "slcan:" + "x" * 100).splitlines())) == 80
    assert max(map(len, table(CAN0, long, "slcan:" + "x" * 100, width=40).splitlines())) == 40


def test_nothing_at_all() -> None:
    assert table() == "no CAN interfaces\n"
    assert table("slcan:x") == "Found by python-can:\n  slcan:x\n"


def test_names_cannot_fool_a_terminal() -> None:
    found = table(Link(1, "c\x1b[2J", "k\n", up=True), "pcan:\x1b]0;x\x07")
    assert "\x1b" not in found
    assert r"c\x1b[2J" in found
    assert r"pcan:\x1b]0;x\x07" in found


@pytest.mark.parametrize(("state", "style"), [("bus off", "31"), ("error warning", "31"), ("error active", "")])
def test_what_is_wrong_is_red(state: str, style: str) -> None:
    link = Link(1, "can0", "can", up=True, controller=Controller(state))
    line = render([ListedInterface("can0", link)], palette=Palette(on=True)).splitlines()[1]
    assert line.startswith(f"\x1b[{style}m") if style else "\x1b" not in line


def test_the_kernel_is_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(links, "list_links", lambda: [VCAN0, CAN0])
    assert listing.list_kernel() == [ListedInterface("vcan0", VCAN0), ListedInterface("can0", CAN0)]


def test_a_kernel_that_cannot_be_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail() -> list[Link]:
        raise OSError

    monkeypatch.setattr(links, "list_links", fail)
    assert listing.list_kernel() == []


def test_drivers_that_find_fail_hang_and_babble(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    asked: list[str] = []

    def detect(kinds: Sequence[str]) -> list[dict[str, Any]]:
        (kind,) = kinds
        asked.append(kind)
        sys.stdout.write("noise")
        sys.stderr.write("noise")
        os.write(1, b"noise of a library in C")
        os.write(2, b"noise of a library in C")
        warnings.warn("noise", stacklevel=1)
        found: dict[str, list[dict[str, Any]]] = {
            "pcan": [
                {"interface": "pcan", "channel": "PCAN_USBBUS2"},
                {"interface": "pcan", "channel": "PCAN_USBBUS1"},
            ],
            "kvaser": [{"interface": "kvaser", "channel": 0}],
            "ixxat": [{"serial": 5}],
        }
        if kind == "vector":
            raise RuntimeError("no driver")
        return found.get(kind, [])

    monkeypatch.setattr(can, "detect_available_configs", detect)
    monkeypatch.setattr(links, "list_links", lambda: [VCAN0])
    names = [listed.name for listed in listing.list_interfaces()]
    assert names == ["vcan0", "kvaser:0", "pcan:PCAN_USBBUS1", "pcan:PCAN_USBBUS2"]
    assert set(asked) == can.VALID_INTERFACES - {"socketcan", "virtual", "socketcand", "udp_multicast"}
    assert capfd.readouterr() == ("", "")
    os.write(2, b"heard again\n")
    assert capfd.readouterr().err == "heard again\n"


def test_drivers_as_they_are() -> None:
    """Whatever this machine has, it is found without an error."""
    assert all(":" in listed.name and listed.link is None for listed in listing.find_devices())


HANGING = """
import threading
import can
from analyzer.live.interfaces import listing

def detect(kinds):
    if kinds == ["slcan"]:
        threading.Event().wait()
    return [{"interface": kinds[0], "channel": 5}]

can.detect_available_configs = detect
listing.PATIENCE = 0.5
print(*(listed.name for listed in listing.find_devices()))
"""


@pytest.mark.slow
def test_a_driver_that_hangs_does_not_hold_up_the_end() -> None:
    command = [sys.executable, "-c", HANGING]
    found = subprocess.run(command, env=environment(), capture_output=True, timeout=LIMIT, check=True)
    names = found.stdout.decode().split()
    assert "pcan:5" in names
    assert "slcan:5" not in names
