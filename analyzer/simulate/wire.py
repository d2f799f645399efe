"""From a payload to frames: identifiers, transfer CRC and tail bytes (4.1.2, 4.1.3), written for senders alone."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from analyzer.simulate.bits import FD_LENGTHS
from dissectors.traffic import SimulatedFrame

if TYPE_CHECKING:
    from dissectors.traffic import Sending

START, END, TOGGLE = 0x80, 0x40, 0x20


def _crc_table() -> list[int]:
    table = []
    for byte in range(256):
        value = byte << 8
        for _ in range(8):
            value = (value << 1 ^ 0x1021 if value & 0x8000 else value << 1) & 0xFFFF
        table.append(value)
    return table


_TABLE = _crc_table()


def crc16(data: bytes, value: int = 0xFFFF) -> int:
    """Return the CRC-16-CCITT-FALSE (5.1), going on from `value`."""
    for byte in data:
        value = value << 8 & 0xFF00 ^ _TABLE[value >> 8 ^ byte]
    return value


@cache
def seed(signature: int) -> int:
    """Return the CRC that a data type's transfers start with: that of its signature, low byte first (4.1.3)."""
    return crc16(signature.to_bytes(8, "little"))


def can_id(sending: Sending) -> int:
    """Return the 29-bit identifier."""
    message = sending.message
    number = sending.priority << 24
    if sending.anonymous:  # the discriminator is 14 bits of the payload's CRC
        return number | (crc16(sending.payload) & 0x7FFE) << 9 | (message.type_id & 3) << 8
    if message.kind == "message":
        return number | message.type_id << 8 | sending.node
    call = message.type_id << 16 | (message.kind == "request") << 15 | (sending.dst or 0) << 8 | 0x80
    return number | call | sending.node


def checked(payload: bytes, signature: int) -> bytes:
    """Return the payload behind its transfer CRC, low byte first."""
    return crc16(payload, seed(signature)).to_bytes(2, "little") + payload


def cut(number: int, body: bytes, transfer_id: int, *, fd: bool = False) -> list[SimulatedFrame]:
    """Cut into frames with tail bytes; `body` starts with its CRC if it needs several. CAN FD is padded with zeros."""
    room = 63 if fd else 7
    parts = [body[at : at + room] for at in range(0, len(body), room)] or [b""]
    if fd:
        size = next(size for size in FD_LENGTHS if size > len(parts[-1]))
        parts[-1] = parts[-1].ljust(size - 1, b"\0")
    return chain(number, parts, transfer_id, fd=fd)


def chain(number: int, parts: list[bytes], transfer_id: int, *, fd: bool = False) -> list[SimulatedFrame]:
    """Return one frame for each part, with the tail bytes of one transfer."""
    if len(parts) == 1:
        return [SimulatedFrame(number, parts[0] + bytes((START | END | transfer_id,)), fd=fd, brs=fd)]
    frames = [
        SimulatedFrame(number, part + bytes((at % 2 * TOGGLE | transfer_id,)), fd=fd, brs=fd)
        for at, part in enumerate(parts)
    ]
    retail(frames[0], START)
    retail(frames[-1], END)
    return frames


def retail(frame: SimulatedFrame, flip: int) -> None:
    """Flip bits of the tail byte."""
    frame.data = frame.data[:-1] + bytes((frame.data[-1] ^ flip,))


def frames(sending: Sending) -> list[SimulatedFrame]:
    """Return the frames of a transfer in classic CAN."""
    payload = sending.payload
    body = payload if len(payload) <= 7 else checked(payload, sending.signature)
    parts = cut(can_id(sending), body, sending.transfer_id)
    for frame in parts:
        frame.sending = sending
    return parts
