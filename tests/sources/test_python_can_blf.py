"""BLF as Vector's programs write it, with objects of every kind, damaged sizes, and containers made to burst."""

from __future__ import annotations

import struct
import zlib
from dataclasses import replace

import pytest
from kit.encode import DLC_LENGTHS
from kit.libraries import (
    BLF_START,
    CLASSIC,
    ERROR_EXT,
    FD_64,
    FD_MESSAGE,
    blf_container,
    blf_file,
    blf_frame,
    blf_message,
    blf_object,
    frames,
    library_file,
    pieces_of,
    total,
)
from kit.rows import BRS, EXTENDED, FD, REMOTE, RX, TX, Fault, Frame, Record, events, records

BUS_ERROR = 0x80


@pytest.mark.slow
def test_objects_of_other_programs() -> None:
    fd = struct.pack("<HBBLLBBB5x64s", 2, 1, 9, 0x8000_0123, 0, 0, 3, 12, bytes(range(64)))
    fd_64 = struct.pack("<BBBBLLLLLLLHBBL", 3, 15, 64, 0, 5, 0, 0x1000, 0, 0, 0, 0, 0, 1, 0, 0) + bytes(range(64))
    error = struct.pack("<HHLBBBxLLH2x8s", 2, 0, 0, 0, 0, 2, 0, 0x123, 0, b"ab")
    objects = [
        blf_message(10),
        blf_message(7, flags=1),  # in steps of 10 us
        blf_message(11, version=2),
        blf_message(12, way=1, channel=2),
        blf_message(13, way=2),  # asked for only
        blf_message(14, way=0x80, number=0x9FFFFFFF, code=3),
        blf_message(15, code=12),
        blf_message(16, channel=0),
        blf_object(FD_MESSAGE, fd, 20),
        blf_object(FD_64, fd_64, 21),
        blf_object(ERROR_EXT, error, 30),
        blf_object(2, struct.pack("<HH", 1, 0), 31),
        blf_object(104, bytes([4]) + bytes(55), 32),
        blf_object(4, bytes(30), 33),  # statistics
    ]
    expected: list[Record] = [
        blf_frame(10),
        blf_frame(70_000),
        blf_frame(11),
        blf_frame(12, flags=TX, bus="can1"),
        Frame(BLF_START + 14, "can0", 0x1FFFFFFF, EXTENDED | REMOTE | RX, b"", 3),
        Frame(BLF_START + 15, "can0", 1, RX, bytes(range(8)), 12),
        blf_frame(16, bus="ch0"),
        Frame(BLF_START + 20, "can1", 0x123, EXTENDED | FD | BRS | TX, bytes(range(12))),
        Frame(BLF_START + 21, "can2", 5, FD | TX, bytes(range(64))),
        Fault(BLF_START + 30, "can1", BUS_ERROR, b""),
        Fault(BLF_START + 31, "can0", BUS_ERROR, b""),
        Fault(BLF_START + 32, "can3", BUS_ERROR, b""),
    ]
    data = b"".join(objects)
    cuts = (50, 100, 333)
    for method in (0, 2):
        whole = blf_file(blf_container(data, method))
        apart = blf_file(
            *(blf_container(data[a:b], method) for a, b in zip((0, *cuts), (*cuts, len(data)), strict=True))
        )
        for capture in (whole, apart):
            for size in (1, 100, 1 << 20):
                pieces, source = pieces_of(".blf", capture, size)
                assert records(pieces) == expected
                assert (total(pieces, "lines"), total(pieces, "other")) == (14, 2)
                assert source.damage is None
    assert "no kinds of error frames" in source.notes[0]
    assert all(piece.stamps & 2 for piece in pieces if piece.frames)  # a date without a zone


def test_error_frames_of_python_can_have_their_class() -> None:
    found = [Fault(BLF_START, "can0", 4, bytes([0, 4, 0, 0, 0, 0, 0, 0])), Fault(BLF_START, "can1", 0x1FF, b"")]
    assert frames(".blf", library_file(".blf", found)) == found


def test_times_of_python_can_have_no_noise() -> None:
    found = [Frame(BLF_START + us * 1000, "can0", 1, RX) for us in (0, 180, 2787, 123_456_789)]
    assert frames(".blf", library_file(".blf", found)) == found


def broken(at: int) -> list[bytes]:
    """Three objects, of which the second has a wrong size, type of header or signature."""
    objects = [blf_message(1), bytearray(blf_message(2)), blf_message(3)]
    objects[1][at] ^= 0xFF
    return [bytes(one) for one in objects]


@pytest.mark.parametrize("at", range(12))
def test_a_damaged_object_hides_no_other(at: int) -> None:
    """Signature, sizes and version of the header: the size may swallow the rest, or be beyond all bounds."""
    pieces, source = pieces_of(".blf", blf_file(blf_container(b"".join(broken(at)))))
    assert records(pieces) == [blf_frame(1), blf_frame(3)]
    assert 1 <= total(pieces, "unreadable") <= 2
    assert source.damage is None


@pytest.mark.parametrize("change", [1, -1, 8, 40, 48, 96])
def test_a_size_that_is_a_little_wrong_hides_no_other(change: int) -> None:
    second = bytearray(blf_message(2))
    second[8] += change
    found = frames(".blf", blf_file(blf_container(blf_message(1) + bytes(second) + blf_message(3) + blf_message(4))))
    assert [record for record in found if record != blf_frame(2)] == [blf_frame(1), blf_frame(3), blf_frame(4)]


@pytest.mark.parametrize(
    ("bad", "reason"),
    [
        (blf_container(blf_message(2), 9), "unknown compression 9"),
        (blf_container(blf_message(2), packed=zlib.compress(blf_message(2))[:-9]), "compressed data ends early"),
        (blf_container(blf_message(2), packed=b"nothing of the kind"), "incorrect header check"),
        (blf_container(blf_message(2), packed=zlib.compress(blf_message(2))[:-1] + b"?"), "incorrect data check"),
    ],
)
def test_a_damaged_container_is_told_and_the_next_one_counts(bad: bytes, reason: str) -> None:
    pieces, source = pieces_of(".blf", blf_file(blf_container(blf_message(1)), bad, blf_container(blf_message(3))))
    assert [record for record in records(pieces) if record != blf_frame(2)] == [blf_frame(1), blf_frame(3)]
    place = 144 + len(blf_container(blf_message(1)))
    assert f"container at byte {place}: {reason}" in [text for _, _, text in events(pieces, "unreadable")]
    assert source.damage is None


def test_garbage_between_containers_is_passed_over() -> None:
    pieces, _ = pieces_of(".blf", blf_file(blf_container(blf_message(1)), b"x" * 5000, blf_container(blf_message(3))))
    assert records(pieces) == [blf_frame(1), blf_frame(3)]
    assert total(pieces, "unreadable") == 1


def test_a_file_that_is_shorter_than_it_says() -> None:
    whole = blf_file(blf_container(blf_message(1)), blf_container(blf_message(2)), size=1000)
    _, source = pieces_of(".blf", whole)
    assert str(source.damage) == f"capture.blf: byte {len(whole)}: BLF data ends early"


@pytest.mark.slow
def test_a_bomb_comes_in_small_pieces() -> None:
    """64 MiB of zeros behind a frame, in a container of 64 KiB; and objects that claim 4 GiB."""
    pieces, _ = pieces_of(
        ".blf", blf_file(blf_container(blf_message(1) + bytes(64 << 20)), blf_container(blf_message(2)))
    )
    assert records(pieces) == [blf_frame(1), blf_frame(2)]
    huge = struct.pack("<4sHHLL", b"LOBJ", 32, 1, 0xFFFFFFFF, CLASSIC)
    pieces, _ = pieces_of(".blf", blf_file(huge, blf_container(huge + blf_message(1)), blf_container(blf_message(2))))
    assert records(pieces) == [blf_frame(1), blf_frame(2)]


def test_data_like_an_object_is_data() -> None:
    """Nobody on the bus can hide a frame, or make one up, by what it sends."""
    inner = blf_message(5)[:64]
    found = [
        Frame(BLF_START, "can0", 1, RX, b"LOBJ"),
        Frame(BLF_START, "can0", 1, RX, b"LOBJ\x20\0\1\0"),
        Frame(BLF_START, "can0", 1, FD | RX, inner.ljust(64, b"\0")),
        Frame(BLF_START, "can0", 1, FD | RX, b"LOBJ" * 16),
    ]
    assert frames(".blf", library_file(".blf", found)) == found
    fd_64 = struct.pack("<BBBBLLLLLLLHBBL", 1, 15, 64, 0, 1, 0, 0x1000, 0, 0, 0, 0, 0, 0, 0, 0) + inner.ljust(64, b"\0")
    assert frames(".blf", blf_file(blf_container(blf_object(FD_64, fd_64) + blf_message(1)))) == [
        replace(found[2], t=BLF_START),
        blf_frame(1),
    ]


def test_lengths_of_can_fd() -> None:
    found = [Frame(BLF_START, "can0", 1, FD | RX, bytes(size)) for size in DLC_LENGTHS]
    assert frames(".blf", library_file(".blf", found)) == found
