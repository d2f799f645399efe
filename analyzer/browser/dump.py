"""The bytes of a row, frame by frame, and which of them are lit."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, NamedTuple

from analyzer.tables import EXTENDED, FD, REMOTE, TAIL_END, TAIL_START
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from analyzer.browser.details import DetailLine
    from analyzer.views.frames.window import RawFrame

Role = Literal["crc", "payload", "tail"]
_CRC = 2  # bytes in front of a payload in several frames


class DumpByte(NamedTuple):
    """A byte of a frame: its value, its role, and its place in the payload, -1 for none."""

    value: int
    role: Role
    place: int = -1


@dataclass(frozen=True, slots=True)
class DumpFrame:
    """A frame with its bytes; `number` as people count."""

    number: int
    identifier: str
    extended: bool
    data: tuple[DumpByte, ...]


class Lit(NamedTuple):
    """Lit parts: bytes as places of a frame and a byte in it; bits of the payload; hexadecimal digits of the id."""

    bytes: frozenset[tuple[int, int]] = frozenset()
    bits: frozenset[int] = frozenset()
    digits: frozenset[int] = frozenset()


def dump(frames: Sequence[tuple[int, RawFrame]], *, transfer: bool) -> list[DumpFrame]:
    """Return frames with the roles of their bytes; those of no transfer have their data as payload."""
    several = len(frames) > 1 or any(
        frame.data and frame.data[-1] & (TAIL_START | TAIL_END) != TAIL_START | TAIL_END for _, frame in frames
    )
    found, place = [], 0
    for k, (number, frame) in enumerate(frames):
        data: list[DumpByte] = []
        size = len(frame.data)
        for n, value in enumerate(frame.data if not frame.flags & REMOTE else b""):
            if transfer and n == size - 1:
                data.append(DumpByte(value, "tail"))
            elif transfer and several and k == 0 and n < _CRC:
                data.append(DumpByte(value, "crc"))
            else:
                data.append(DumpByte(value, "payload", place))
                place += 1
        note = " FD" if frame.flags & FD else ""
        found.append(DumpFrame(number, frame.id_text + note, bool(frame.flags & EXTENDED), tuple(data)))
    return found


def lit_by(line: DetailLine | None, frames: Sequence[DumpFrame]) -> Lit:
    """Return what a line of the details lights."""
    if line is None:
        return Lit()
    bits: Iterable[int] = ()
    if line.inside:
        bits = line.inside
    elif line.bits is not None:
        bits = range(line.bits[0], line.bits[1] + 1)
    bits = frozenset(bits)
    places = {bit // 8 for bit in bits}
    found = set()
    for k, frame in enumerate(frames):
        for n, one in enumerate(frame.data):
            if one.place in places or (line.part and one.role == line.part):
                found.add((k, n))
    digits: set[int] = set()
    if line.identifier is not None and frames and frames[0].extended:
        first, last = (one + 3 for one in line.identifier)  # 29 bits in 8 digits
        digits = set(range(first // 4, last // 4 + 1))
    return Lit(frozenset(found), bits, frozenset(digits))


def line_at(lines: Sequence[DetailLine], frames: Sequence[DumpFrame], at: tuple[int, int]) -> int | None:
    """Return the line of the details that speaks of a byte, the narrowest of several."""
    frame, byte = at
    if frame >= len(frames) or byte >= len(frames[frame].data):
        return None
    one = frames[frame].data[byte]
    if one.place < 0:
        return next((k for k, line in enumerate(lines) if line.part == one.role), None)
    best, size = None, 0
    for k, line in enumerate(lines):
        if line.bits is None or line.inside or line.text.startswith("["):
            continue
        first, last = line.bits
        if first // 8 <= one.place <= last // 8 and (best is None or last - first <= size):
            if best is not None and last - first == size:
                continue
            best, size = k, last - first
    return best


def binary(frames: Sequence[DumpFrame], lit: Lit, most: int = 6) -> list[tuple[str, frozenset[int]]]:
    """Return the lit bytes of the payload as `byte N` and eight digits, with the digits that are lit."""
    values = {one.place: one.value for frame in frames for one in frame.data if one.place >= 0}
    places = sorted({bit // 8 for bit in lit.bits} & set(values))[:most]
    return [(f"{values[place]:08b}", frozenset(bit % 8 for bit in lit.bits if bit // 8 == place)) for place in places]
