"""Faults of the transfer CRC, of padding, and of transfers that no receiver can check or hold."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.simulate import wire
from analyzer.simulate.bits import FD_LENGTHS
from analyzer.simulate.faults.helpers import nanoseconds, number, repeat, sender, telemetry, transmit, unknown
from dissectors.times import MILLISECOND, SECOND
from dissectors.traffic import Fault, Step

if TYPE_CHECKING:
    from collections.abc import Callable

    from dissectors.traffic import Case, Sending

# No known types have these numbers of the range for vendors.
_LONG = unknown(20814, 0x0DDBA11CAFE17EA5)
_SEVERAL = unknown(20815, 0x7E1E3E7A5EA7BEEF)


def _bit(case: Case, sending: Sending) -> Step:
    """Flip a bit behind the CRC, so that only the payload differs."""
    frames = sending.frames
    if len(frames) < 2:
        return Step.SKIP
    at, bit = case.random.randrange(len(sending.payload)), case.random.randrange(8)
    frame = frames[(at + 2) // 7]
    data = bytearray(frame.data)
    data[(at + 2) % 7] ^= 1 << bit
    frame.data = bytes(data)
    case.say(f"bit {bit} of byte {at + 1} of a payload of {len(sending.payload)} bytes was flipped")
    return Step.DONE


def _without(sending: Sending) -> bytes:
    return wire.crc16(sending.payload).to_bytes(2, "little") + sending.payload


def _swapped(sending: Sending) -> bytes:
    body = wire.checked(sending.payload, sending.signature)
    return body[1::-1] + body[2:]


def _at_the_end(sending: Sending) -> bytes:
    body = wire.checked(sending.payload, sending.signature)
    return body[2:] + body[:2]


def _padded(sending: Sending) -> bytes:
    body = wire.checked(sending.payload, sending.signature)
    return body + bytes(-len(body) % 7)


def _with_crc(sending: Sending, crc: int) -> bytes:
    return crc.to_bytes(2, "little") + sending.payload


def _reversed(sending: Sending) -> bytes:
    return _with_crc(sending, wire.crc16(sending.signature.to_bytes(8, "big") + sending.payload))


def _from_zero(sending: Sending) -> bytes:
    return _with_crc(sending, wire.crc16(sending.signature.to_bytes(8, "little") + sending.payload, 0))


def _inverted(sending: Sending) -> bytes:
    return _with_crc(sending, wire.crc16(sending.payload, wire.seed(sending.signature)) ^ 0xFFFF)


_MISTAKES: dict[str, tuple[Callable[[Sending], bytes], str]] = {
    "nosignature": (_without, "the CRC was computed without the signature"),
    "swapped": (_swapped, "the CRC was sent high byte first"),
    "trailing": (_at_the_end, "the CRC was sent behind the payload"),
    "padding": (_padded, "the last frame was filled up with zeros that the CRC does not cover"),
    "reversed": (_reversed, "the CRC was computed with the bytes of the signature in reversed order"),
    "fromzero": (_from_zero, "the CRC was computed from 0 instead of FFFF"),
    "finalxor": (_inverted, "the CRC was inverted at the end"),
}
# What one transfer alone does not prove: it takes two of one sender.
_BY_TWO = ("reversed", "fromzero", "finalxor")


def _mistaken(case: Case, sending: Sending) -> Step:
    if len(sending.frames) < 2:
        return Step.SKIP
    signature, how = number(case, "signature"), str(case.options["how"])
    session = case.state.setdefault("session", (sending.node, sending.name))
    if (sending.node, sending.name) != session:
        return Step.SKIP
    make, done = _MISTAKES[how]
    if signature:
        body = wire.checked(sending.payload, signature)
        done = f"the CRC was computed with the signature {signature:016X} instead of {sending.signature:016X}"
    else:
        body = make(sending)
    if body == wire.checked(sending.payload, sending.signature):  # there was nothing to fill up, or both bytes agree
        return Step.SKIP
    sending.frames = wire.cut(wire.can_id(sending), body, sending.transfer_id)
    case.say(done)
    if how == "padding":
        case.answer.also = (*case.answer.also, "TYP-002")
    left = case.state["left"] = case.state.get("left", 1 + (how in _BY_TWO and not signature)) - 1
    return Step.MORE if left else Step.DONE


def _fd_padding(case: Case, sending: Sending) -> Step:
    """Send a single CAN FD frame between whose payload and tail there is room."""
    message, size = sending.message, len(sending.payload)
    fitting = [length for length in FD_LENGTHS if length > size]
    if message.max_bytes != message.max_bytes_with_length or len(fitting) < 2:
        return Step.SKIP
    long = case.options["how"] == "long"
    length = fitting[1] if long else fitting[0]
    room = length - 1 - size
    if not room:
        return Step.SKIP
    filling = bytes(room) if long else bytes(0xA5 for _ in range(room))
    (frame,) = wire.cut(wire.can_id(sending), sending.payload, sending.transfer_id, fd=True)
    frame.data = sending.payload + filling + frame.data[-1:]
    sending.frames = [frame]
    case.say(f"a CAN FD frame of {length} bytes: {size} of payload, then {room} times {filling[0]:02X}, then the tail")
    return Step.DONE


def _long(case: Case) -> None:
    """Send three short transfers first, so that everybody believes the type."""
    node, size = sender(case), number(case, "bytes")
    if size <= 1023:
        return

    def send(turn: int) -> None:
        count = 20 if turn < 3 else size
        transmit(case, node, _LONG, {"data": case.random.randbytes(count)})

    case.say(f"3 transfers of 20 bytes of the unknown type {_LONG.type_id}, then one of {size} bytes")
    repeat(case, 20 * MILLISECOND, 4, send)


def _consistent(case: Case) -> None:
    """Send transfers whose CRCs start from one value; one that does not fit in is the last but one."""
    node, times, wrong = sender(case), number(case, "times"), number(case, "outliers")
    start = wire.seed(_SEVERAL.signature)
    if times - wrong < 2:
        return

    def flip(sending: Sending) -> None:
        frame = sending.frames[-1]
        frame.data = bytes((frame.data[0] ^ 0x10,)) + frame.data[1:]

    def send(turn: int) -> None:
        shape = flip if times - 1 - wrong <= turn < times - 1 else None
        values = {"data": bytes((turn, 0, 0x40)) + case.random.randbytes(13)}
        transmit(case, node, _SEVERAL, values, shape)

    done = f"{times} transfers of the unknown type {_SEVERAL.type_id}, whose CRCs all start from {start:04X}"
    if wrong:
        case.answer.also = (*case.answer.also, "TRF-010")
        done += f"; {wrong} of them with a flipped bit"
    case.say(done)
    repeat(case, nanoseconds(case, "period"), times, send)


FAULTS: tuple[Fault, ...] = (
    Fault("TRF-010", "the transfer CRC does not fit the payload: a flipped bit", frames=_bit, fits=telemetry),
    Fault(
        "TRF-011",
        "a CRC that a known mistake explains, or another signature=",
        frames=_mistaken,
        fits=telemetry,
        options={"how": "nosignature", "signature": 0},
        choices={"how": tuple(_MISTAKES)},
        also=("TRF-010",),
        lasts=SECOND // 4,
    ),
    Fault(
        "TRF-029",
        "a transfer too long for receivers that count to 1023",
        start=_long,
        options={"bytes": 1100},
        also=("CAN-015", "TRF-031"),
        lasts=150 * MILLISECOND,
    ),
    Fault(
        "TRF-030",
        "padding of a CAN FD frame that is not zero, or more than needed",
        frames=_fd_padding,
        fits=telemetry,
        options={"how": "nonzero"},
        choices={"how": ("nonzero", "long")},
        also=("CAN-003", "TYP-002"),
    ),
    Fault(
        "TRF-031",
        "transfers of an unknown type whose CRCs start from one value, outliers= excepted",
        start=_consistent,
        options={"times": 8, "period": 0.05, "outliers": 0},
        also=("CAN-015",),
        lasts=400 * MILLISECOND,
    ),
)
