"""A finding's frames: candump lines taken apart, so that a reader sees what each byte is for."""

from __future__ import annotations

import re

from analyzer.tables import TAIL_END, TAIL_START
from analyzer.views.details.hexdump import tail_words
from dissectors.records import dataclass

_CRC_BYTES = 2
_ERROR = 0x20000000
_LINE = re.compile(
    r"\((?P<time>\d{1,20}\.\d{1,9})\) (?P<bus>\S{1,64}) (?P<id>[0-9A-F]{8}|[0-9A-F]{3})"
    r"#(?P<fd>#[0-9A-F])?(?P<data>(?:[0-9A-F]{2}){0,64})(?: [TR])?",
)


@dataclass(frozen=True, slots=True)
class FrameLine:
    """One frame: its bytes by role, as spaced hexadecimal; `raw` alone for a line that is no data frame."""

    raw: str
    time: str = ""
    bus: str = ""
    id: str = ""
    length: str = ""
    crc: str = ""
    payload: str = ""
    tail: str = ""
    words: str = ""


def frame_line(text: str, *, dronecan: bool = True) -> FrameLine:
    """Take a line of `candump -l` apart; bytes have roles only in a frame that may be `dronecan` (4.1.3)."""
    found = _LINE.fullmatch(text)
    if found is None:
        return FrameLine(text)
    data = bytes.fromhex(found["data"])
    roles = dronecan and len(found["id"]) == 8 and not int(found["id"], 16) & _ERROR
    body, tail = (data[:-1], data[-1:]) if roles else (data, b"")
    first_of_several = bool(tail) and tail[0] & (TAIL_START | TAIL_END) == TAIL_START
    crc = body[:_CRC_BYTES] if first_of_several else b""
    return FrameLine(
        raw=text,
        time=found["time"],
        bus=found["bus"],
        id=found["id"],
        length=f"{'FD ' if found['fd'] else ''}[{len(data)}]",
        crc=crc.hex(" ").upper(),
        payload=body[len(crc) :].hex(" ").upper(),
        tail=tail.hex().upper(),
        words=tail_words(tail[0]) if tail else "",
    )
