"""How long a frame occupies the bus: its bits, stuffing and the three of the intermission included (ISO 11898-1)."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dissectors.traffic import SimulatedFrame

# Data lengths that CAN FD has a code for.
FD_LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)
# CRC delimiter, acknowledge slot and delimiter, end of frame; then the intermission.
_TRAILER = 1 + 1 + 1 + 7
INTERMISSION = 3
_CRC15 = 0x4599
# Data bits are sent this many times faster than the others where a CAN FD frame switches.
FD_SPEED = 5
# A state is 2 * run + bit: how many equal bits were sent last, and which.
_START = 0


def _crc15_table() -> list[int]:
    table = []
    for byte in range(256):
        value = byte << 7
        for _ in range(8):
            value = (value << 1 ^ _CRC15 if value & 0x4000 else value << 1) & 0x7FFF
        table.append(value)
    return table


def _walk(state: int, bits: int, count: int) -> tuple[int, int]:
    """Return state and stuff bits after `count` further bits."""
    run, last, stuffed = state >> 1, state & 1, 0
    for at in range(count - 1, -1, -1):
        bit = bits >> at & 1
        run = run + 1 if run and bit == last else 1
        last = bit
        if run == 5:
            run, last, stuffed = 1, 1 - last, stuffed + 1
    return run << 1 | last, stuffed


_CRC_TABLE = _crc15_table()
# For every state and byte: the next state, times 8, and the stuff bits (at most 2).
_STUFF = [[(found := _walk(state, byte, 8))[0] << 3 | found[1] for byte in range(256)] for state in range(10)]
# The same from the start of a frame, for what is left over when the rest is whole bytes.
_FIRST = [[_walk(_START, bits, count) for bits in range(1 << count)] for count in range(8)]


def crc15(bits: int, count: int) -> int:
    """Return the CRC of a classic frame over its unstuffed bits from start of frame to the last of its data."""
    value = 0
    for byte in bits.to_bytes((count + 7) // 8, "big"):
        value = (value << 8 ^ _CRC_TABLE[value >> 7 & 0xFF ^ byte]) & 0x7FFF
    return value


def stuffing(bits: int, count: int) -> int:
    """Count the stuff bits in a sequence of `count` bits, the first of them the start of frame."""
    odd = count % 8
    state, stuffed = _FIRST[odd][bits >> (count - odd)]
    for byte in (bits & (1 << count - odd) - 1).to_bytes(count // 8, "big"):
        found = _STUFF[state][byte]
        state = found >> 3
        stuffed += found & 7
    return stuffed


def _head(frame: SimulatedFrame, *, length: int) -> tuple[int, int]:
    """Return the bits of a classic frame from start of frame to its length code, and how many."""
    rtr = int(frame.remote)
    code = min(length, 8)
    if frame.extended:
        bits = (frame.id >> 18) << 20 | 0b11 << 18 | frame.id & 0x3FFFF
        return bits << 7 | rtr << 6 | code, 39
    return frame.id << 7 | rtr << 6 | code, 19


def arbitration(frame: SimulatedFrame) -> int:
    """Return the bits that compete for the bus, in their order: the lowest wins."""
    rtr = int(frame.remote)
    if frame.extended:
        return (frame.id >> 18) << 21 | 0b11 << 19 | (frame.id & 0x3FFFF) << 1 | rtr
    return frame.id << 21 | rtr << 20


def classic(frame: SimulatedFrame) -> int:
    """Count bit times of a classic frame: 67 + 8 n and the stuffing with a 29-bit identifier, 47 + 8 n with 11 bits."""
    data = b"" if frame.remote else frame.data
    bits, count = _head(frame, length=len(data) if frame.dlc is None else frame.dlc)
    if data:
        bits, count = bits << 8 * len(data) | int.from_bytes(data, "big"), count + 8 * len(data)
    bits, count = bits << 15 | crc15(bits, count), count + 15
    return count + stuffing(bits, count) + _TRAILER + INTERMISSION


def flexible(frame: SimulatedFrame) -> tuple[int, int]:
    """Count bit times of a CAN FD frame: at the nominal rate, and at the rate of its data phase."""
    base = frame.id if not frame.extended else (frame.id >> 18) << 20 | 0b11 << 18 | frame.id & 0x3FFFF
    # Identifier, then RRS, (IDE,) FDF, the reserved bit and BRS, which still has the nominal rate.
    head = base << 4 | 0b0100 | int(frame.brs) if frame.extended else base << 5 | 0b00100 | int(frame.brs)
    count = 36 if frame.extended else 17
    code = next(code for code, size in enumerate(FD_LENGTHS) if size >= len(frame.data))
    size = FD_LENGTHS[code]
    body = code << 8 * size | int.from_bytes(frame.data.ljust(size, b"\0"), "big")
    length = 1 + 4 + 8 * size
    nominal = count + stuffing(head, count)
    bits, total = head << length | body, count + length
    # Stuff count and CRC have fixed stuff bits, one before each four; where the data would end with a stuff bit of its
    # own, the first of them takes its place.
    whole = total + stuffing(bits >> 1, total - 1)
    check = 4 + (17 if size <= 16 else 21)
    fast = whole - nominal + check + -(-check // 4)
    return nominal + _TRAILER + INTERMISSION, fast


def duration(frame: SimulatedFrame, bit_time: int) -> int:
    """Return ns on the bus, intermission included; `bit_time` is that of the nominal rate, in ns."""
    if not frame.fd:
        return classic(frame) * bit_time
    slow, fast = flexible(frame)
    return slow * bit_time + fast * bit_time // (FD_SPEED if frame.brs else 1)
