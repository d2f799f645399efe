"""The log of pydronecan's file driver, written by that driver."""

from __future__ import annotations

import struct
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from dronecan.driver.common import CANFrame
from dronecan.driver.file import file as LogFile  # noqa: N812 - the driver's class is called file
from kit.rows import EXTENDED, FD, REMOTE, Frame, read, traffic

if TYPE_CHECKING:
    from pathlib import Path


def log(path: Path, seed: int, count: int) -> tuple[bytes, list[Frame]]:
    """What the driver writes, and what it was given; it keeps times as floats and cuts them to microseconds."""
    kept = [frame for frame in traffic(seed, count, 5_000_000_000, 1_234_000, fd_flags=0) if not frame.flags & REMOTE]
    writer = LogFile(str(path))
    frames = []
    for frame in kept:
        t = frame.t / 1e9
        writer.send_frame(CANFrame(frame.id, frame.data, bool(frame.flags & EXTENDED), t, canfd=bool(frame.flags & FD)))
        frames.append(replace(frame, t=int(t * 1e6) * 1000, bus="can0"))
    writer.close()
    writer.file = None  # the driver closes it once more when it goes
    return path.read_bytes(), frames


@pytest.mark.parametrize("size", [1, 50, 1 << 20])
def test_frames_read_as_they_were_written(tmp_path: Path, size: int) -> None:
    data, frames = log(tmp_path / "log", 1, 300)
    result = read("dronecan", data, size)
    assert len(frames) > 200
    assert result.frames == frames
    assert (result.lines["lines"], result.damage) == (len(frames), None)


def test_damaged_data_is_not_believed(tmp_path: Path) -> None:
    data, frames = log(tmp_path / "log", 2, 12)
    at = 0
    for index, frame in enumerate(frames):
        end = at + 20 + len(frame.data)
        for byte in range(at + 20, end):
            damaged = bytearray(data)
            damaged[byte] ^= 0x10
            result = read("dronecan", bytes(damaged))
            assert result.frames == frames[:index] + frames[index + 1 :]
            assert result.events == [("unreadable", "wrong CRC")]
        at = end


def test_every_wrong_byte_costs_one_record(tmp_path: Path) -> None:
    data, frames = log(tmp_path / "log", 3, 12)
    for at in range(len(data)):
        damaged = bytearray(data)
        damaged[at] ^= 0xFF
        result = read("dronecan", bytes(damaged))
        assert len(set(frames) - set(result.frames)) <= 1
        assert read("dronecan", bytes(damaged), 3) == result


def test_what_stands_before_the_end_is_delivered(tmp_path: Path) -> None:
    data, frames = log(tmp_path / "log", 4, 12)
    for length in range(1, len(data)):
        result = read("dronecan", data[:length])
        assert result.frames == frames[: len(result.frames)]
        assert result.damage is None or result.damage[1] == "pydronecan log ends early"


def test_foreign_bytes_between_records(tmp_path: Path) -> None:
    data, frames = log(tmp_path / "log", 5, 5)
    end = 20 + len(frames[0].data)
    for garbage in (b"4", b"4)", b"4)" * 20, bytes(300), struct.pack("<HQHHHI", 0x2934, 1, 0, 8, 0, 1)):
        result = read("dronecan", data[:end] + garbage + data[end:])
        assert result.frames == frames
        assert result.texts[0].endswith(f"; {len(garbage)} bytes passed over")
