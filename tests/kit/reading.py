"""What the native readers make of a capture, as plain values; and frames at random to make captures of."""

from __future__ import annotations

import random
from dataclasses import dataclass, field
from typing import NamedTuple

from analyzer._native import Reader
from analyzer.decode.engine import LINES, Totals
from analyzer.tables import EVENTS
from kit.encode import DLC_LENGTHS

EXTENDED, REMOTE, FD, BRS, ESI, TX, RX = 1, 2, 8, 16, 32, 64, 128
NO_TIME = -(1 << 63)


class Frame(NamedTuple):
    t: int
    bus: str
    id: int
    flags: int
    data: bytes

    @property
    def word(self) -> int:
        """The identifier as the kernel has it."""
        return self.id | (self.flags & EXTENDED) << 31 | (self.flags & REMOTE) << 29

    @property
    def line(self) -> str:
        """The frame as candump logs it."""
        digits = f"{self.id:08X}" if self.flags & EXTENDED else f"{self.id:03X}"
        body = self.data.hex().upper()
        if self.flags & FD:
            body = f"#{self.flags >> 4 & 3:X}{body}"
        if self.flags & REMOTE:
            body = f"R{self.flags >> 8}"
        direction = " T" if self.flags & TX else " R" if self.flags & RX else ""
        return f"({self.t // 10**9}.{self.t % 10**9:09d}) {self.bus} {digits}#{body}{direction}\n"


@dataclass
class Result:
    frames: list[Frame] = field(default_factory=list)
    events: list[tuple[str, str]] = field(default_factory=list)
    numbers: list[int] = field(default_factory=list)
    lines: dict[str, int] = field(default_factory=lambda: dict.fromkeys(LINES, 0))
    damage: tuple[int, str] | None = None

    @property
    def texts(self) -> list[str]:
        return [text for _, text in self.events]


def read(form: str, data: bytes, size: int = 1 << 20) -> Result:
    """All rows of a capture that comes in chunks of this size."""
    reader, result = Reader(form), Result()
    for at in range(0, len(data), size):
        reader.feed(data[at : at + size])
        _take(reader, result)
    reader.finish()
    _take(reader, result)
    result.damage = reader.damage
    result.numbers.sort()
    assert Totals(result.lines).balanced
    assert len(set(result.numbers)) == len(result.numbers)
    assert result.lines["frames"] == len(result.frames)
    return result


def _take(reader: Reader, result: Result) -> None:
    piece = reader.take()
    frames, events = piece.columns()
    ends = memoryview(frames["data_offset"]).cast("i")
    columns = [
        memoryview(frames[name]).cast(code) for name, code in (("t", "q"), ("bus", "B"), ("id", "I"), ("flags", "H"))
    ]
    for row, (t, bus, number, flags) in enumerate(zip(*columns, strict=True)):
        data = bytes(frames["data"][ends[row] : ends[row + 1]])
        result.frames.append(Frame(t, piece.buses[bus], number, flags, data))
    ends = memoryview(events["text_offset"]).cast("i")
    for row, kind in enumerate(events["kind"]):
        result.events.append((EVENTS[kind], bytes(events["text"][ends[row] : ends[row + 1]]).decode("ascii")))
    for table in (frames, events):
        result.numbers += memoryview(table["line"]).cast("I")
    for name, count in piece.lines.items():
        if name in result.lines:
            result.lines[name] += count


def traffic(seed: int, count: int, start: int, step: int, fd_flags: int = BRS | ESI) -> list[Frame]:
    """Frames of every kind a `step` of nanoseconds apart, on two buses, without directions."""
    source, frames = random.Random(seed), []
    for index in range(count):
        flags = source.choice((0, EXTENDED))
        data = source.randbytes(source.randint(0, 8))
        kind = source.randrange(4)
        if kind == 0:
            flags |= REMOTE | len(data) << 8
            data = b""
        elif kind == 1:
            flags |= FD | source.choice((0, BRS, ESI, BRS | ESI)) & fd_flags
            data = source.randbytes(source.choice(DLC_LENGTHS))
        number = source.getrandbits(29 if flags & EXTENDED else 11)
        frames.append(Frame(start + index * step, source.choice(("can0", "can1")), number, flags, data))
    return frames
