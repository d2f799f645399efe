"""The kernel's answers about CAN interfaces, byte by byte, and no answers."""

from __future__ import annotations

import errno
import struct
from typing import Any, Self

import pytest

from analyzer.live import links
from analyzer.live.interfaces import _links


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


def test_links_as_the_kernel_tells_them(real_links: Any) -> None:
    timing = attribute(1, struct.pack("=8I", 500_000, *range(7)))
    info = [attribute(18, attribute(1, kind) + attribute(2 | 0x8000, data)) for kind, data in (
        (b"can\0", timing), (b"vcan\0", b""), (b"vxcan", b""))]  # fmt: skip
    real_links(
        link(9, "lo", arp=772) + link(3, "can1", info[0], attribute(4, struct.pack("=I", 16)), flags=0),
        link(2, "vcan0", attribute(4, struct.pack("=I", 72)), info[1])
        + link(5, "vx0", attribute(5, struct.pack("=I", 6)), attribute(37, struct.pack("=i", 0)), info[2]),
        DONE,
    )
    assert links.links() == [
        links.Link(2, "vcan0", "vcan", up=True, fd=True),
        links.Link(3, "can1", "can", bit_rate=500_000),
        links.Link(5, "vx0", "vxcan", up=True, peer=6, elsewhere=True),
    ]


def test_gateways_as_the_kernel_tells_them(real_links: Any) -> None:
    ends = attribute(9, struct.pack("=I", 2)) + attribute(10, struct.pack("=I", 3))
    other = part(24, struct.pack("=12B", 2, *bytes(11)))
    asked = real_links(other + part(24, struct.pack("=BBH", 29, 1, 0) + ends) + DONE)
    assert links.gateways() == [(2, 3)]
    assert asked.asked[16] == 29


@pytest.mark.parametrize(
    "answers",
    [[], [part(2, struct.pack("=i", -errno.EPERM))], [struct.pack("=IHHII", 4, 16, 0, 0, 0)]],
    ids=["silence", "an error", "nonsense"],
)
def test_a_kernel_that_does_not_answer(real_links: Any, answers: list[bytes]) -> None:
    real_links(*answers)
    with pytest.raises(OSError, match=r"timed out|not permitted|rotocol"):
        links.links()


def test_a_system_without_netlink(real_links: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    real_links()
    monkeypatch.delattr("socket.AF_NETLINK", raising=False)
    with pytest.raises(OSError, match="not supported"):
        links.links()
    assert _links() == []
