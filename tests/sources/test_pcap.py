"""pcap and pcapng, written here from the description of the formats, must read as the same frames of candump do."""

from __future__ import annotations

import struct
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from kit.rows import FD, RX, TX, Frame, read, traffic

if TYPE_CHECKING:
    from collections.abc import Iterable

MICROS, NANOS = 0xA1B2C3D4, 0xA1B23C4D
CAN, ETHERNET, COOKED, COOKED2 = 227, 1, 113, 276
START = 1_700_000_000_000_000_000


def packet(frame: Frame, order: str = ">", *, padded: bool = True) -> bytes:
    """`struct can_frame` or `struct canfd_frame`."""
    length, flags, room = len(frame.data), 0, 8
    if frame.flags & FD:
        flags, room = 4 | frame.flags >> 4 & 3, 64
    elif not frame.data:
        length = frame.code
    fill = bytes(room - len(frame.data)) if padded else b""
    return struct.pack(order + "IBBxx", frame.word, length, flags) + frame.data + fill


def pcap(
    frames: Iterable[Frame], order: str = "<", magic: int = MICROS, link: int = CAN, *, padded: bool = True
) -> bytes:
    out = struct.pack(order + "IHHiIII", magic, 2, 4, 0, 0, 1 << 18, link)
    unit = 1 if magic == NANOS else 1000
    for frame in frames:
        if link == CAN:
            body = packet(frame, padded=padded)
        else:
            kind, protocol, index = 4 if frame.flags & TX else 1, 0x0D if frame.flags & FD else 0x0C, int(frame.bus[3:])
            head = {
                COOKED: struct.pack(">HHH8xH", kind, 280, 0, protocol),
                COOKED2: struct.pack(">HxxIHBB8x", protocol, index, 280, kind, 0),
            }
            body = head[link] + packet(frame, order, padded=padded)
        out += struct.pack(order + "IIII", frame.t // 10**9, frame.t % 10**9 // unit, len(body), len(body)) + body
    return out


class Section:
    """A section of a pcapng capture under way."""

    def __init__(self, order: str) -> None:
        self.order, self.out = order, b""
        self.block(0x0A0D0D0A, struct.pack(order + "IHHq", 0x1A2B3C4D, 1, 0, -1))

    def block(self, kind: int, body: bytes) -> None:
        body += bytes(-len(body) % 4)
        length = len(body) + 12
        self.out += struct.pack(self.order + "II", kind, length) + body + struct.pack(self.order + "I", length)

    def options(self, *options: tuple[int, bytes]) -> bytes:
        packed = [
            struct.pack(self.order + "HH", code, len(value)) + value + bytes(-len(value) % 4) for code, value in options
        ]
        return b"".join(packed) + bytes(4 if packed else 0)

    def interface(self, link: int = CAN, *options: tuple[int, bytes]) -> None:
        self.block(1, struct.pack(self.order + "HHI", link, 0, 0) + self.options(*options))

    def packet(self, interface: int, stamp: int, body: bytes, direction: int = 0) -> None:
        head = struct.pack(self.order + "IIIII", interface, stamp >> 32, stamp & 0xFFFFFFFF, len(body), len(body))
        flags = ((2, struct.pack(self.order + "I", direction)),) if direction else ()
        self.block(6, head + body + bytes(-len(body) % 4) + self.options(*flags))


@pytest.mark.sampled(2)
@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("magic", [MICROS, NANOS])
@pytest.mark.parametrize("padded", [True, False])
def test_pcap_reads_as_candump(order: str, magic: int, padded: bool) -> None:
    frames = [
        replace(frame, bus="can0") for frame in traffic(1, 400, START, 1_001_001 if magic == NANOS else 1_001_000)
    ]
    data = pcap(frames, order, magic, padded=padded)
    assert read("candump", "".join(frame.line for frame in frames).encode()).frames == frames
    for size in (1, 17, 1 << 20):
        result = read("pcap", data, size)
        assert result.frames == frames
        assert (result.lines["lines"], result.damage) == (400, None)


@pytest.mark.parametrize("order", ["<", ">"])
def test_cooked_pcap(order: str) -> None:
    frames = [replace(frame, flags=frame.flags | TX * (frame.id & 1)) for frame in traffic(2, 300, START, 1_000_000)]
    result = read("pcap", pcap(frames, order, link=COOKED2), 100)
    assert result.frames == [replace(frame, bus="if" + frame.bus[3:]) for frame in frames]
    result = read("pcap", pcap(frames, order, link=COOKED), 100)
    assert result.frames == [replace(frame, bus="can0") for frame in frames]


@pytest.mark.parametrize(
    ("resolution", "unit"), [(b"", 1000), (b"\6", 1000), (b"\3", 1_000_000), (b"\11", 1), (b"\x89", 1_953_125)]
)
def test_pcapng_reads_as_candump(resolution: bytes, unit: int) -> None:
    frames = [
        replace(frame, flags=frame.flags | (0, RX, TX)[frame.id % 3]) for frame in traffic(3, 400, START, 3 * unit)
    ]
    data = b""
    for order, part in (("<", frames[:150]), (">", frames[150:300]), ("<", frames[300:])):
        section = Section(order)
        clock = [(9, resolution)] if resolution else []
        offset = struct.pack(order + "q", -1000)
        section.interface(ETHERNET, (2, b"eth0"))
        section.interface(CAN, (2, b"can1"), *clock, (14, offset))
        section.interface(CAN, (1, b"a comment"), (2, b"can0"), *clock)
        for frame in part:
            index = 1 + (frame.bus == "can0")
            t = frame.t + (0 if index == 2 else 1000 * 10**9)
            direction = {RX: 1, TX: 2}.get(frame.flags & (RX | TX), 0)
            section.packet(index, t // unit, packet(frame), direction)
            section.packet(0, 0, b"an ethernet frame")
        section.block(4, bytes(8))
        data += section.out
    whole = read("pcapng", data)
    assert whole.frames == frames
    assert (whole.lines["other"], whole.damage) == (400 + 3 * 5, None)
    assert read("pcapng", data, 13) == whole


def test_packets_without_time_and_drops() -> None:
    section = Section("<")
    section.interface()
    frame = Frame(None, "can0", 0x123, 0, b"\1\2")
    section.block(3, struct.pack("<I", 16) + packet(frame))
    section.block(5, struct.pack("<III", 0, 0, 1) + section.options((4, bytes(8)), (5, struct.pack("<Q", 12))))
    result = read("pcapng", section.out)
    assert result.frames == [frame]
    assert result.events == [("drop", "12 frames dropped by the interface, 0 by the system so far")]


def test_an_interface_without_a_name_shares_none() -> None:
    section = Section("<")
    section.interface(CAN, (2, b"can1"))
    section.interface()
    frames = [Frame(START, bus, number, 0, b"") for number, bus in enumerate(("can1", "interface1"))]
    for index, frame in enumerate(frames):
        section.packet(index, START // 1000, packet(frame))
    assert read("pcapng", section.out).frames == frames


def captures() -> dict[str, bytes]:
    frames = [Frame(START, "can0", at, 1, bytes([at] * 8)) for at in range(1, 9)]
    section = Section(">")
    section.interface()
    for frame in frames:
        section.packet(0, frame.t // 1000, packet(frame))
    return {"pcap": pcap(frames), "pcapng": section.out}


@pytest.mark.parametrize("form", ["pcap", "pcapng"])
def test_what_stands_before_the_end_is_delivered(form: str) -> None:
    data = captures()[form]
    frames, seen = read(form, data).frames, 0
    for length in range(len(data)):
        result = read(form, data[:length])
        assert result.frames == frames[: len(result.frames)]
        assert result.damage is None or result.damage[1] == f"{form} data ends early"
        assert len(result.frames) in (seen, seen + 1)
        seen = len(result.frames)
    assert seen == len(frames) - 1


@pytest.mark.parametrize("form", ["pcap", "pcapng"])
def test_a_wrong_byte_costs_one_packet(form: str) -> None:
    data = captures()[form]
    frames = read(form, data).frames
    head = len(data) - len(frames) * {"pcap": 32, "pcapng": 48}[form]
    for at in range(head, len(data)):
        damaged = bytearray(data)
        damaged[at] ^= 0x41
        result = read(form, bytes(damaged))
        assert len(set(frames) - set(result.frames)) <= 1
        assert result.lines["lines"] + (result.damage is not None) >= 8


def test_no_capture_of_can() -> None:
    result = read("pcap", pcap([], link=COOKED)[:20] + struct.pack("<I", ETHERNET) + bytes(100))
    assert (result.damage, result.lines["lines"]) == ((0, "link type 1 carries no CAN frames"), 0)
    section = Section("<")
    section.interface(ETHERNET)
    section.packet(0, 1, b"an ethernet frame")
    result = read("pcapng", section.out)
    assert (result.damage, result.lines["other"]) == ((0, "link type 1 carries no CAN frames"), 3)
    assert read("pcapng", b"\n\r\r\n" + bytes(100)).damage == (0, "not pcapng data")
    assert read("pcap", b"").damage is None
