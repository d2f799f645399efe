"""Which bus a person means, as python-can understands it, and what is said when it cannot be had."""

from __future__ import annotations

import errno
import re
from typing import TYPE_CHECKING, Any

import can
import can.util
import pytest

from analyzer.live.interfaces import links
from analyzer.live.interfaces.naming import InterfaceError, close_bus, open_bus, resolve

if TYPE_CHECKING:
    from pathlib import Path


CLASSIC = ["f_clock=8000000", "brp=1", "tseg1=5", "tseg2=2", "sjw=2", "nof_samples=1"]
WITH_FD = [
    "f_clock=80000000", "nom_brp=1", "nom_tseg1=119", "nom_tseg2=40", "nom_sjw=40",
    "data_brp=1", "data_tseg1=29", "data_tseg2=10", "data_sjw=10",
]  # fmt: skip


@pytest.fixture(autouse=True)
def nothing_configured(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(can.util, "CONFIG_FILES", [])
    monkeypatch.setattr(links, "list_links", list)
    for name in ("CAN_INTERFACE", "CAN_CHANNEL", "CAN_BITRATE", "CAN_CONFIG"):
        monkeypatch.delenv(name, raising=False)


@pytest.mark.parametrize(
    ("text", "options", "kind", "channel", "rest"),
    [
        ("can0", {}, "socketcan", "can0", {"fd": True}),
        ("can0@500000", {}, "socketcan", "can0", {"fd": True, "bitrate": 500_000}),
        ("virtual:demo", {}, "virtual", "demo", {}),
        ("virtual:", {}, "virtual", None, {}),
        ("slcan:/dev/ttyACM0@1000000", {}, "slcan", "/dev/ttyACM0", {"bitrate": 1_000_000}),
        ("slcan:/dev/ttyACM0@115200@1000000", {}, "slcan", "/dev/ttyACM0@115200", {"bitrate": 1_000_000}),
        ("udp_multicast:ff15::1", {}, "udp_multicast", "ff15::1", {"hop_limit": 0}),
        ("udp_multicast:239.1.2.3", {"bus_kwargs": ["hop_limit=1"]}, "udp_multicast", "239.1.2.3", {"hop_limit": 1}),
        ("demo", {"interface": "virtual"}, "virtual", "demo", {}),
        (None, {"interface": "virtual", "channel": "demo"}, "virtual", "demo", {}),
        (None, {"channel": "vcan1"}, "socketcan", "vcan1", {"fd": True}),
        (
            "pcan:PCAN_USBBUS1", {"bitrate": 500_000, "data_bitrate": 2_000_000, "fd": True}, "pcan", "PCAN_USBBUS1",
            {"bitrate": 500_000, "data_bitrate": 2_000_000, "fd": True},
        ),
        ("virtual:x@500000", {"interface": "virtual", "bitrate": 500_000}, "virtual", "x", {"bitrate": 500_000}),
        (
            "udp_multicast:", {"bus_kwargs": ["port=5000"]}, "udp_multicast", None,
            {"hop_limit": 0, "port": 5000},
        ),
    ],
)  # fmt: skip
def test_what_is_meant(
    text: str | None, options: dict[str, Any], kind: str, channel: str | None, rest: dict[str, Any]
) -> None:
    got = resolve(text, options)
    assert (got.kind, got.channel, dict(got.options)) == (kind, channel, rest)


@pytest.mark.parametrize(
    ("text", "options", "reason"),
    [
        ("socketcn:can0", {}, "socketcn:can0: no interface type is called 'socketcn' (near: socketcan"),
        ("zz:can0", {}, "(there is: "),
        ("can0", {"interface": "vitrual"}, "no interface type is called 'vitrual' (near: virtual"),
        ("can0", {"channel": "can1"}, "can0 and --channel can1 contradict each other"),
        ("virtual:x", {"interface": "socketcan"}, "contradict"),
        ("virtual:x@500000", {"bitrate": 125_000}, "contradict"),
        (None, {"interface": "socketcan"}, "which SocketCAN interface"),
        ("virtual:x", {"bus_kwargs": ["vcan0"]}, "--bus-kwargs: 'vcan0' is not key=value"),
        ("virtual:x", {"timing": ["brp=1"]}, "--timing takes all of f_clock brp"),
        ("virtual:x", {"timing": [text.replace("brp=1", "brp=x") for text in CLASSIC]}, "--timing: "),
        ("virtual:x", {"bus_kwargs": ["port=70000"]}, "python-can's configuration: "),
    ],
)
def test_what_is_refused(text: str | None, options: dict[str, Any], reason: str) -> None:
    with pytest.raises(ValueError, match=re.escape(reason)) as caught:
        resolve(text, options)
    assert "\n" not in str(caught.value)


def test_files_and_environment_of_python_can(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "can.conf").write_text("[default]\ninterface = virtual\nchannel = lab\nbitrate = 250000\n")
    monkeypatch.setattr(can.util, "CONFIG_FILES", [str(tmp_path / "can.conf")])
    got = resolve(None, {})
    assert (got.kind, got.channel, got.bit_rate) == ("virtual", "lab", 250_000)
    assert resolve("bench", {}).name == "virtual:bench"
    monkeypatch.setenv("CAN_CHANNEL", "hall")
    monkeypatch.setenv("CAN_BITRATE", "125000")
    got = resolve(None, {})
    assert (got.channel, got.bit_rate, resolve(None, {"bitrate": 50_000}).bit_rate) == ("hall", 125_000, 50_000)
    monkeypatch.setenv("CAN_CONFIG", "{")
    with pytest.raises(ValueError, match="python-can's configuration: is no JSON"):
        resolve(None, {})


def test_the_bit_rate_of_a_timing() -> None:
    assert resolve("virtual:x", {"timing": CLASSIC}).bit_rate == 1_000_000
    assert resolve("virtual:x", {"timing": WITH_FD}).bit_rate == 500_000
    assert resolve("virtual:x", {}).bit_rate is None


def test_the_bit_rate_that_the_kernel_knows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(links, "list_links", lambda: [links.Link(1, "can0", "can", bit_rate=250_000)])
    assert resolve("can0", {}).bit_rate == 250_000
    assert resolve("can1", {}).bit_rate is None
    assert resolve("virtual:can0", {}).bit_rate is None


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (OSError(errno.EAFNOSUPPORT, "Address family not supported by protocol"), "this system has no SocketCAN"),
        (OSError(errno.EPERM, "Operation not permitted"), "Operation not permitted"),
        (OSError(errno.ENODEV, "No such device"), "no such interface (there is none)"),
        (can.CanInitializationError("could not\n create", 5), "could not"),
        (TypeError("missing"), "missing"),
        (KeyError(), "KeyError"),
    ],
)
def test_what_cannot_be_opened(monkeypatch: pytest.MonkeyPatch, error: Exception, said: str) -> None:
    def fail(**_: object) -> None:
        raise error

    monkeypatch.setattr(can, "Bus", fail)
    with pytest.raises(InterfaceError) as caught:
        open_bus(resolve("can0", {}))
    assert (str(caught.value), caught.value.reason) == (f"can0: {said}", said)


def test_a_name_that_the_kernel_does_not_know(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(links, "list_links", lambda: [links.Link(1, "can0"), links.Link(2, "vcan0")])
    with pytest.raises(InterfaceError, match=r"^can7: no such interface \(there is can0, vcan0\)$"):
        open_bus(resolve("can7", {}))


def test_what_another_interface_says_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    """The kernel's words are explained for SocketCAN alone."""

    def fail(**_: object) -> None:
        raise OSError(errno.ENODEV, "No such device")

    monkeypatch.setattr(can, "Bus", fail)
    with pytest.raises(InterfaceError, match=r"^slcan:x: No such device$"):
        open_bus(resolve("slcan:x", {}))


def test_a_bus_that_cannot_be_closed() -> None:
    class Broken:
        def shutdown(self) -> None:
            raise can.CanOperationError("pulled out")

    close_bus(Broken())  # type: ignore[arg-type]


def test_it_opens_what_is_meant() -> None:
    with open_bus(resolve("virtual:here", {})) as one, can.Bus("here", interface="virtual") as other:
        one.send(can.Message(arbitration_id=7))
        got = other.recv(5)
        assert got is not None
        assert got.arbitration_id == 7
