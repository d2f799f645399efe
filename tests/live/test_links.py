"""The kernel's answers about CAN interfaces, byte by byte, and no answers."""

from __future__ import annotations

import errno
import struct
from typing import Any, Self

import pytest

from analyzer.live.interfaces import links
from analyzer.live.interfaces.naming import _links


class Netlink:
    """Answers with these datagrams."""

    def __init__(self, *answers: bytes) -> None:
        self._answers = list(answers)
        self.asked = b""

    def __call__(self, *_: object) -> Netlink:
        return self

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def settimeout(self, seconds: float) -> None:
        assert seconds > 0

    def send(self, data: bytes) -> None:
        self.asked = data

    def recv(self, _: int) -> bytes:
        if not self._answers:
            raise TimeoutError("timed out")
        return self._answers.pop(0)


def part(kind: int, body: bytes) -> bytes:
    return struct.pack("=IHHII", 16 + len(body), kind, 2, 1, 0) + body + bytes(-len(body) % 4)


def attribute(kind: int, data: bytes) -> bytes:
    return struct.pack("=HH", 4 + len(data), kind) + data + bytes(-len(data) % 4)


def link(index: int, name: str, *more: bytes, arp: int = 280, flags: int = 0x41) -> bytes:
    return part(
        16, struct.pack("=BxHiII", 0, arp, index, flags, 0) + attribute(3, name.encode() + b"\0") + b"".join(more)
    )


DONE = part(3, struct.pack("=i", 0))


@pytest.fixture
def real_links(monkeypatch: pytest.MonkeyPatch) -> Any:
    def answer(*answers: bytes) -> Netlink:
        made = Netlink(*answers)
        monkeypatch.setattr("socket.socket", made)
        return made

    return answer


def number(value: int) -> bytes:
    return struct.pack("=I", value)


def test_links_as_the_kernel_tells_them(real_links: Any) -> None:
    timing = attribute(1, struct.pack("=8I", 500_000, *range(7)))
    info = [attribute(18, attribute(1, kind) + attribute(2 | 0x8000, data)) for kind, data in (
        (b"can\0", timing), (b"vcan\0", b""), (b"vxcan", b""))]  # fmt: skip
    real_links(
        link(9, "lo", arp=772) + link(3, "can1", info[0], attribute(4, number(16)), flags=0),
        link(2, "vcan0", attribute(4, number(72)), info[1])
        + link(5, "vx0", attribute(5, number(6)), attribute(37, struct.pack("=i", 0)), info[2]),
        DONE,
    )
    assert links.list_links() == [
        links.Link(2, "vcan0", "vcan", up=True, fd=True, mtu=72),
        links.Link(
            3, "can1", "can", bit_rate=500_000, mtu=16, controller=links.Controller(timing=links.Timing(500_000))
        ),
        links.Link(5, "vx0", "vxcan", up=True, peer=6, elsewhere=True),
    ]


def test_a_controller_as_its_driver_tells_it(real_links: Any) -> None:
    data = [
        attribute(1, struct.pack("=8I", 500_000, 875, *range(6))), attribute(4, number(2)),
        attribute(5, struct.pack("=2I", 0xFFFF, 0x22)), attribute(6, number(100)),
        attribute(8, struct.pack("=2H", 130, 7)), attribute(9, struct.pack("=8I", 2_000_000, 750, *range(6))),
    ]  # fmt: skip
    counts = attribute(3, struct.pack("=6I", 11, 12, 13, 14, 15, 16))
    traffic = attribute(23, struct.pack("=24Q", *range(100, 124)))
    info = attribute(18, attribute(1, b"can\0") + attribute(2, b"".join(data)) + counts)
    real_links(link(3, "can0", attribute(4, number(72)), attribute(13, number(10)), info, traffic) + DONE)
    assert links.list_links() == [
        links.Link(
            3, "can0", "can", up=True, fd=True, bit_rate=500_000, mtu=72, queue=10,
            controller=links.Controller(
                state="error passive", timing=links.Timing(500_000, 875), data_timing=links.Timing(2_000_000, 750),
                restart_ms=100, modes=("listen only", "fd"), tx_errors=130, rx_errors=7,
                bus_errors=11, bus_offs=14, restarts=16,
            ),
            traffic=links.Traffic(received=100, sent=101, receive_dropped=106, send_dropped=107),
        )
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("data", "state"),
    [
        *((attribute(4, number(code)), name) for code, name in enumerate(links._STATES)),
        (attribute(4, number(99)), ""),
        (b"", ""),
    ],
)
def test_states_of_a_controller(real_links: Any, data: bytes, state: str) -> None:
    real_links(link(3, "can0", attribute(18, attribute(1, b"can\0") + attribute(2, data))) + DONE)
    (found,) = links.list_links()
    assert found.controller == links.Controller(state=state)
    assert found.bit_rate is None


def test_gateways_as_the_kernel_tells_them(real_links: Any) -> None:
    ends = attribute(9, struct.pack("=I", 2)) + attribute(10, struct.pack("=I", 3))
    other = part(24, struct.pack("=12B", 2, *bytes(11)))
    asked = real_links(other + part(24, struct.pack("=BBH", 29, 1, 0) + ends) + DONE)
    assert links.list_gateways() == [(2, 3)]
    assert asked.asked[16] == 29


@pytest.mark.parametrize(
    "answers",
    [[], [part(2, struct.pack("=i", -errno.EPERM))], [struct.pack("=IHHII", 4, 16, 0, 0, 0)]],
    ids=["silence", "an error", "nonsense"],
)
def test_a_kernel_that_does_not_answer(real_links: Any, answers: list[bytes]) -> None:
    real_links(*answers)
    with pytest.raises(OSError, match=r"timed out|not permitted|rotocol"):
        links.list_links()


def test_a_system_without_netlink(real_links: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    real_links()
    monkeypatch.delattr("socket.AF_NETLINK", raising=False)
    with pytest.raises(OSError, match="not supported"):
        links.list_links()
    assert _links() == []
