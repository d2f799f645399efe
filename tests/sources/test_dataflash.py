"""ArduPilot's dataflash log, written here from ArduPilot's own description of its records."""

from __future__ import annotations

import struct

import pytest
from kit.dataflash import FMT, description
from kit.encode import DLC_LENGTHS
from kit.rows import FD, Frame, read, traffic

CANF, CAFD, PARM = 216, 217, 64
BYTES = ",".join(f"B{at}" for at in range(8))
QUADS = ",".join(f"D{at}" for at in range(8))


HEAD = (
    description(FMT, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns")
    + description(PARM, "PARM", "QNff", "TimeUS,Name,Value,Default")
    + description(CANF, "CANF", "QBIBBBBBBBBB", f"TimeUS,Bus,Id,DLC,{BYTES}")
    + description(CAFD, "CAFD", "QBIBQQQQQQQQ", f"TimeUS,Bus,Id,DLC,{QUADS}")
)
PARAMETER = b"\xa3\x95" + struct.pack("<BQ16sff", PARM, 5, b"CAN_P1_DRIVER", 1, 1)


def record(frame: Frame) -> bytes:
    code = DLC_LENGTHS.index(len(frame.data)) if frame.flags & FD else len(frame.data) or frame.code
    kind, room = (CAFD, "64s") if frame.flags & FD else (CANF, "8s")
    values = frame.t // 1000, int(frame.bus[3:]), frame.word, code, frame.data
    return b"\xa3\x95" + struct.pack(f"<BQBIB{room}", kind, *values)


def log(seed: int, count: int) -> tuple[bytes, list[Frame]]:
    frames = traffic(seed, count, 12_345_000, 17_000, fd_flags=0)
    return HEAD + b"".join(record(frame) + PARAMETER for frame in frames), frames


@pytest.mark.sampled(4)
@pytest.mark.parametrize("size", [1, 50, 1 << 20])
def test_frames_read_as_they_were_logged(size: int) -> None:
    data, frames = log(1, 300)
    result = read("dataflash", data, size)
    assert result.frames == frames
    assert (result.lines["other"], result.events, result.damage) == (304, [], None)
    assert read("candump", "".join(frame.line for frame in frames).encode()).lines["frames"] == 300


@pytest.mark.parametrize("fill", [b"\0", b"\xff"])
def test_unwritten_memory_at_the_end_is_no_damage(fill: bytes) -> None:
    data, frames = log(2, 20)
    result = read("dataflash", data + 5000 * fill, 64)
    assert (result.frames, result.lines["lines"], result.damage) == (frames, 44, None)
    result = read("dataflash", data + 50 * fill + data[len(HEAD) :], 64)
    assert (result.frames, result.texts, result.damage) == (frames * 2, ["no record; 50 bytes passed over"], None)


def test_garbage_costs_no_sound_record() -> None:
    data, frames = log(3, 10)
    middle = len(HEAD) + len(record(frames[0]))
    for garbage in (b"x", b"\xa3\x95", b"\xa3\x95\x01\x02\x03", bytes(range(160)), data[:2] * 3):
        result = read("dataflash", data[:middle] + garbage + data[middle:])
        assert result.frames == frames
        assert result.texts[0].endswith(f"; {len(garbage)} bytes passed over")


def test_what_stands_before_the_end_is_delivered() -> None:
    data, frames = log(4, 6)
    for length in range(1, len(data)):
        result = read("dataflash", data[:length])
        assert result.frames == frames[: len(result.frames)]
        assert result.damage is None or result.damage[1] == "dataflash log ends early"
    assert len(result.frames) == 6


def test_every_wrong_byte_is_survived() -> None:
    data, frames = log(5, 8)
    for at in range(len(data)):
        damaged = bytearray(data)
        damaged[at] ^= 0xFF
        result = read("dataflash", bytes(damaged))
        assert at < len(HEAD) or len(set(frames) & set(result.frames)) >= 6
