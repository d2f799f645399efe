"""Short sequences of frames, written by hand: the words that the tests of the reassembly speak in."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import encode

if TYPE_CHECKING:
    from encode import Frame, Transfer

SECOND, MS = 10**9, 10**6
START = 1_700_000_000 * SECOND
STATUS = {"error_count": 7, "voltage": 48.5, "current": 1.0, "temperature": 40.0, "rpm": -5, "power_rating_pct": 3}


def status(transfer_id: int, rpm: int = -5, **more: Any) -> Transfer:
    """Three frames."""
    return encode.transfer("ESCStatus", STATUS | {"rpm": rpm, "esc_index": 2}, 10, transfer_id, **more)


def push(transfer_id: int, size: int = 25) -> Transfer:
    """Five frames."""
    fields = {"data_sequence": transfer_id, "data": [(transfer_id + k) % 256 for k in range(size)]}
    return encode.transfer("PUSHCAN", fields, 10, transfer_id)


def throttle(transfer_id: int, value: int = 100, **more: Any) -> Transfer:
    """One frame."""
    return encode.transfer("RawCommand", {"cmd": [value] * 4}, 1, transfer_id, **more)


def retail(frame: Frame, flip: int) -> Frame:
    return replace(frame, data=frame.data[:-1] + bytes([frame.data[-1] ^ flip]))


def lines(*parts: Frame | list[Frame], timed: bool = True) -> bytes:
    """A candump log, a frame every millisecond from START on; a frame with a time of its own sets the clock."""
    frames = [f for part in parts for f in (part if isinstance(part, list) else [part])]
    out, now = [], START
    for frame in frames:
        now = frame.t if frame.t >= START else now + MS
        out.append(encode.log_line(replace(frame, t=now), 9) if timed else encode.console_line(frame))
    return "".join(line + "\n" for line in out).encode()


def at(t: int, frame: Frame) -> Frame:
    return replace(frame, t=START + t)


def tail(frame: Frame, byte: int) -> Frame:
    return replace(frame, data=frame.data[:-1] + bytes([byte]))
