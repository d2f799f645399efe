"""Frames as long as they are on a real bus: CRC and stuffing, bit by bit, against the simulator's tables."""

from __future__ import annotations

from itertools import groupby

from hypothesis import given
from hypothesis import strategies as st

from analyzer.simulate import bits
from dissectors.traffic import SimulatedFrame


def text(value: int, width: int) -> str:
    return format(value, f"0{width}b")


def crc15(stream: str) -> str:
    """ISO 11898-1's shift register, one bit at a time."""
    value = 0
    for bit in stream:
        feedback = int(bit) ^ value >> 14
        value = value << 1 & 0x7FFF
        if feedback:
            value ^= 0x4599
    return text(value, 15)


def stuffed(stream: str) -> str:
    out = ""
    for bit in stream:
        out += bit
        if out[-5:] == bit * 5:
            out += "10"[int(bit)]
    return out


def head(frame: SimulatedFrame) -> str:
    rtr, size = str(int(frame.remote)), text(len(frame.data) if frame.dlc is None else frame.dlc, 4)
    if not frame.extended:
        return "0" + text(frame.id, 11) + rtr + "00" + size
    number = text(frame.id, 29)
    return "0" + number[:11] + "11" + number[11:] + rtr + "00" + size


def classic(frame: SimulatedFrame) -> int:
    body = "" if frame.remote else "".join(text(byte, 8) for byte in frame.data)
    stream = head(frame) + body
    return len(stuffed(stream + crc15(stream))) + len("1" + "01" + "1111111" + "111")


@st.composite
def frames(draw: st.DrawFn) -> SimulatedFrame:
    extended = draw(st.booleans())
    number = draw(st.integers(0, (1 << (29 if extended else 11)) - 1) | st.sampled_from((0, 0x7FF)))
    byte = st.integers(0, 255) | st.sampled_from((0, 0xFF, 0xF8, 0x07, 0x1F, 0xE0))
    data = bytes(draw(st.lists(byte, max_size=8)))
    remote = draw(st.integers(0, 9)) == 0
    return SimulatedFrame(number, b"" if remote else data, extended, remote, dlc=len(data) if remote else None)


@given(frames())
def test_length_is_that_of_the_bits_one_by_one(frame: SimulatedFrame) -> None:
    assert bits.classic(frame) == classic(frame)


def test_known_lengths() -> None:
    """PROTOCOL facts: 131 to 160 bits for 8 bytes; the all-zero frame is the longest there is."""
    assert crc15("0") == text(0, 15)
    assert bits.crc15(1, 1) == 0x4599
    assert bits.classic(SimulatedFrame(0x1FFFFFFF, bytes([0x55] * 8))) >= 131
    longest = max(
        bits.classic(SimulatedFrame(number, bytes([fill] * 8))) for number in (0, 0x1FFFFFFF) for fill in range(256)
    )
    assert 131 < longest <= 160


@given(frames())
def test_lengths_stay_between_the_limits(frame: SimulatedFrame) -> None:
    size = 0 if frame.remote else len(frame.data)
    least = (67 if frame.extended else 47) + 8 * size
    assert least <= bits.classic(frame) <= least + (least - 14) // 4


@given(frames(), frames())
def test_arbitration_is_the_first_bit_that_differs(one: SimulatedFrame, other: SimulatedFrame) -> None:
    def sent(frame: SimulatedFrame) -> str:
        return head(frame)[: 33 if frame.extended else 14].ljust(33, "0")

    assert (bits.arbitration(one) < bits.arbitration(other)) == (sent(one) < sent(other))


@given(st.data(), st.sampled_from(bits.FD_LENGTHS), st.booleans())
def test_can_fd_has_two_speeds(data: st.DataObject, size: int, extended: bool) -> None:
    """Dynamic stuffing ends with the data; the CRC field has a fixed stuff bit in front of every four bits.

    ISO 11898-1: where the data would end with a stuff bit, the first fixed one stands in its place.
    """
    byte = st.integers(0, 255) | st.sampled_from((0, 0xFF, 0xE0, 0x1F, 0xF0))
    payload = bytes(data.draw(st.lists(byte, min_size=size, max_size=size)))
    number = data.draw(st.integers(0, (1 << (29 if extended else 11)) - 1))
    frame = SimulatedFrame(number, payload, extended, fd=True, brs=data.draw(st.booleans()))
    digits = text(number, 29)
    start = "0" + (digits[:11] + "11" + digits[11:] if extended else text(number, 11))
    nominal = start + ("010" if extended else "0010") + str(int(frame.brs))
    code = text(bits.FD_LENGTHS.index(size), 4)
    whole = stuffed(nominal + "0" + code + "".join(text(value, 8) for value in payload))
    ended = whole[-6:-1] in {"00000", "11111"} and whole[-1] != whole[-2]
    dynamic = len(whole) - ended - len(stuffed(nominal))
    check = 4 + (17 if size <= 16 else 21)
    slow, fast = bits.flexible(frame)
    assert slow == len(stuffed(nominal)) + 10 + 3
    assert fast == dynamic + check + -(-check // 4)
    assert bits.duration(frame, 1000) == slow * 1000 + fast * (200 if frame.brs else 1000)


def test_stuffing_never_leaves_six_equal_bits() -> None:
    for value in range(1 << 12):
        stream = "0" + text(value, 12)
        assert max(len(list(run)) for _, run in groupby(stuffed(stream))) <= 5
        assert bits.stuffing(value, 13) == len(stuffed(stream)) - 13
