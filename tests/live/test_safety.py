"""What may be real, and what would move: both are believed unless the opposite is known."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

import dissectors
from analyzer.live.interfaces import links
from analyzer.live.interfaces.links import Link
from analyzer.live.replay import safety
from analyzer.live.replay.safety import Guard, Survey, find_doubt
from analyzer.views.actuation import render

if TYPE_CHECKING:
    from pathlib import Path

    from dissectors.registry import Registry


@pytest.fixture
def kernel(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, int]]:
    """A machine with a real interface and virtual ones; the list takes rules of its gateway."""
    rules: list[tuple[int, int]] = []
    known = [
        Link(1, "can0", "can"), Link(2, "vcan0", "vcan"), Link(3, "vcan1", "vcan"), Link(4, "vx0", "vxcan", peer=5),
        Link(5, "vx1", "vxcan", peer=4), Link(6, "vx2", "vxcan", peer=4, elsewhere=True), Link(7, "vcan9", ""),
    ]  # fmt: skip
    monkeypatch.setattr(links, "list_links", lambda: known)
    monkeypatch.setattr(links, "list_gateways", lambda: rules)
    return rules


@pytest.mark.usefixtures("kernel")
@pytest.mark.parametrize(
    ("kind", "channel", "options", "why"),
    [
        ("virtual", "x", {}, ""),
        ("socketcan", "vcan0", {}, ""),
        ("socketcan", "vx0", {}, ""),
        ("socketcan", "can0", {}, "the kernel calls it can, not vcan"),
        ("socketcan", "vcan9", {}, "no kind is known of it, not vcan"),
        ("socketcan", "vx2", {}, "its other end is out of sight, in another network namespace"),
        ("socketcan", "vcan7", {}, "the kernel does not know it"),
        ("slcan", "vcan0", {}, "slcan is no virtual interface"),
        ("socketcand", "vcan0", {}, "socketcand is no virtual interface"),
        ("udp_multicast", None, {}, "its datagrams leave this machine, unless hop_limit=0"),
        ("udp_multicast", None, {"hop_limit": 1}, "its datagrams leave this machine, unless hop_limit=0"),
        ("udp_multicast", None, {"hop_limit": 0}, ""),
    ],
)
def test_what_may_be_real(kind: str, channel: str | None, options: dict[str, object], why: str) -> None:
    assert find_doubt(kind, channel, options) == why


def test_where_frames_go_on_to(kernel: list[tuple[int, int]]) -> None:
    kernel += [(2, 3), (3, 2), (3, 4)]
    assert find_doubt("socketcan", "vcan0", {}) == ""
    kernel.append((5, 1))
    for name in ("vcan0", "vcan1", "vx0"):
        assert find_doubt("socketcan", name, {}) == "its frames go on to can0: the kernel calls it can, not vcan"
    kernel[:] = [(1, 2)]
    assert find_doubt("socketcan", "vcan0", {}) == ""
    kernel[:] = [(2, 99)]
    assert find_doubt("socketcan", "vcan0", {}).startswith("its frames go on to another interface")


@pytest.mark.parametrize("question", ["list_links", "list_gateways"])
@pytest.mark.usefixtures("kernel")
def test_a_kernel_that_cannot_be_asked_is_not_trusted(monkeypatch: pytest.MonkeyPatch, question: str) -> None:
    def fail() -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(links, question, fail)
    assert find_doubt("socketcan", "vcan0", {}) == "what it is cannot be asked (Operation not permitted)"


def message(type_id: int, node: int) -> int:
    return 0x10 << 24 | type_id << 8 | node


def service(type_id: int, dst: int, src: int, *, request: bool) -> int:
    return 0x1E << 24 | type_id << 16 | request << 15 | dst << 8 | 0x80 | src


@pytest.mark.parametrize(
    ("number", "name", "node", "actuates"),
    [
        (message(1030, 10), "RawCommand", 10, True),
        (message(1033, 125), "ParamCfg", 125, True),
        (message(1038, 125), "PUSHSCI", 125, True),
        (message(1034, 11), "ESCStatus", 11, False),
        (message(1039, 11), "PUSHCAN", 11, False),
        (message(1332, 11), "ParamGet", 11, False),
        (message(341, 11), "uavcan.protocol.NodeStatus", 11, False),
        (message(1010, 10), "uavcan.equipment.actuator.ArrayCommand", 10, True),
        (message(20100, 10), "com.hobbywing.esc.RawCommand", 10, True),
        (message(4, 10), "uavcan.protocol.GlobalTimeSync", 10, False),
        (message(29999, 10), "unknown message 29999", 10, True),
        (0x1E_ABCD_00 | 0x100, "uavcan.protocol.dynamic_node_id.Allocation", 0, False),
        (0x1E_ABCC_00, "unknown message 0", 0, True),
        (service(1, 11, 10, request=True), "uavcan.protocol.GetNodeInfo.Request", 10, False),
        (service(5, 11, 10, request=True), "uavcan.protocol.RestartNode.Request", 10, True),
        (service(5, 11, 10, request=False), "uavcan.protocol.RestartNode.Response", 10, False),
        (service(11, 11, 10, request=True), "uavcan.protocol.param.GetSet.Request", 10, True),
        (service(200, 11, 10, request=True), "unknown service 200", 10, True),
    ],
)
def test_what_would_move(registry: Registry, number: int, name: str, node: int, actuates: bool) -> None:
    guard = Guard(registry)
    for _ in range(2):
        got = guard.judge(number, extended=True)
        assert (got.name, got.node, got.actuates) == (name, node, actuates)
    assert not guard.judge(number, extended=True, remote=True).actuates
    assert guard.judge(number, extended=True).actuates == actuates


def test_other_protocols_are_unknown(registry: Registry) -> None:
    got = Guard(registry).judge(0x201, extended=False)
    assert (got.name, got.node, got.actuates) == (safety.FOREIGN, None, True)


def test_memory_is_bounded(registry: Registry, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(safety, "_MOST", 3)
    guard = Guard(registry)
    for node in range(1, 100):
        assert guard.judge(message(1030, node), extended=True).node == node
        assert len(guard._known) <= 3


def test_the_table(registry: Registry) -> None:
    guard, survey = Guard(registry), Survey()
    for number in (*[message(1030, 10)] * 400, message(1033, 125), *[message(341, 11)] * 7, message(1010, 9)):
        survey.add(guard.judge(number, extended=True))
    survey.add(guard.judge(0x201, extended=False))
    assert render(survey.rows(), 2.0) == (
        "  Node  Type                                      Frames        Hz\n"
        "     -  no DroneCAN                                    1       0.5\n"
        "     9  uavcan.equipment.actuator.ArrayCommand         1       0.5\n"
        "    10  RawCommand                                   400     200.0\n"
        "   125  ParamCfg                                       1       0.5\n"
    )


@pytest.mark.parametrize("first", [True, False])
def test_an_id_that_two_types_share_actuates_if_one_of_them_does(tmp_path: Path, first: bool) -> None:
    """Whichever the preferred one is: who listens may take it for the other."""
    for name in ("one", "other"):
        actuates = (name == "one") is first
        folder = tmp_path / name / name
        folder.mkdir(parents=True)
        (folder / "20900.Pump.uavcan").write_text(f"uint16 pressure_{name}\n")
        message = f'[message.Pump]\ndsdl = "{name}/20900.Pump.uavcan"\ntype = "{name}.Pump"\nactuates = true\n'
        (tmp_path / name / "profile.toml").write_text(f'name = "{name}"\nversion = "1"\n' + message * actuates)
    guard = Guard(dissectors.load([tmp_path / "one", tmp_path / "other"]))
    assert guard.judge(31 << 24 | 20900 << 8 | 11, extended=True, remote=False).actuates


@pytest.mark.parametrize(("type_id", "name"), [(1030, "RawCommand"), (1033, "ParamCfg")])
def test_what_moves_moves_without_a_source_too(type_id: int, name: str) -> None:
    verdict = Guard(dissectors.load()).judge(type_id << 8, extended=True)
    assert (verdict.name, verdict.actuates) == (name, True)


def test_a_request_for_a_node_id_moves_nothing() -> None:
    assert not Guard(dissectors.load()).judge(0x1E1C4100, extended=True).actuates
