"""MCAP files that are cut, changed or lie about lengths: what is sound is delivered, what is not is told."""

from __future__ import annotations

import random
import struct
import tracemalloc
from functools import cache
from typing import TYPE_CHECKING

import lz4.frame
import pytest
import zstandard
from kit import mcaps
from kit.mcaps import LAYOUTS, Builder, Frame, build, cut, frames, from_file, from_pieces

if TYPE_CHECKING:
    from pathlib import Path

ROWS = frames(40)
KINDS = [(compression, chunked) for chunked in (True, False) for compression in ("none", "zstd", "lz4")][:4]
CHUNK, MESSAGE, STATISTICS, DATA_END = 6, 5, 11, 15
HEAD = struct.Struct("<BQ")


@cache
def small(compression: str, chunked: bool, layout: str = "can_msgs") -> bytes:
    """Five chunks of up to 10 messages, or none."""
    return build(ROWS, layout, compression=compression, chunked=chunked, chunk_size=700)


def records(data: bytes) -> list[tuple[int, int, int]]:
    """Opcode, first byte and end of every record."""
    found, at = [], 8
    while at < len(data) - 8:
        opcode, length = HEAD.unpack_from(data, at)
        found.append((opcode, at, at + 9 + length))
        at += 9 + length
    return found


@pytest.mark.slow
@pytest.mark.parametrize(("compression", "chunked"), KINDS)
def test_cut_at_every_byte(compression: str, chunked: bool) -> None:
    data = small(compression, chunked)
    end = next(end for opcode, _, end in records(data) if opcode == DATA_END)
    last = 0
    for size in range(8, len(data)):
        got = from_pieces([data[:size]])
        reason = "MCAP data ends early" + (", no message is missing" if size >= end else "")
        assert got.damage == f"byte {size}: {reason}", size
        assert got.frames == ROWS[: len(got.frames)]
        assert not got.texts
        assert len(got.frames) >= last
        last = len(got.frames)
    assert last == len(ROWS)


@pytest.mark.slow
def test_an_unfinished_chunk_is_read_as_far_as_it_goes() -> None:
    data = build(frames(3000), chunk_size=1 << 20)
    _, start, end = next(record for record in records(data) if record[0] == CHUNK)
    for part, least in ((0.25, 700), (0.5, 1450), (0.99, 2900)):
        assert len(from_pieces([data[: start + int((end - start) * part)]]).frames) >= least
    for compression in ("zstd", "lz4"):
        rows = [Frame(row.t, row.id, random.Random(row.t).randbytes(8)) for row in frames(40_000)]
        data = build(rows, compression=compression, chunk_size=8 << 20)
        got = from_pieces([data[: len(data) // 2]])
        assert got.frames == rows[: len(got.frames)]
        assert len(got.frames) > 10_000


@pytest.mark.slow
@pytest.mark.parametrize("compression", ["none", "zstd", "lz4"])
def test_one_changed_byte_in_chunks_costs_one_chunk(tmp_path: Path, compression: str) -> None:
    """Wherever it is: whatever is delivered is right, and if anything is not, that is told."""
    data = small(compression, chunked=True)
    for at in range(8, len(data)):
        bad = bytearray(data)
        bad[at] ^= 1 << at % 8
        got = from_file(tmp_path / "x.mcap", bytes(bad))
        assert is_part(got.frames, ROWS), at
        assert len(got.frames) >= len(ROWS) - 10, at
        assert got.told or got.frames == ROWS, at
        assert got.lines["other"] == 0, at


def is_part(rows: list[Frame], of: list[Frame]) -> bool:
    """In the same order, some perhaps left out."""
    rest = iter(of)
    return all(row in rest for row in rows)


@pytest.mark.slow
def test_one_changed_byte_without_chunks() -> None:
    rows = ROWS[:15]
    data = build(rows, chunked=False)
    for at in range(8, len(data)):
        for bit in (0, 4, 7):
            bad = bytearray(data)
            bad[at] ^= 1 << bit
            got = from_pieces([bytes(bad)])
            definition = at < records(data)[2][2]
            assert definition or sum(row in rows for row in got.frames) >= len(rows) - 2, (at, bit)
            assert got == from_pieces(cut(bytes(bad), 100)), (at, bit)


def test_a_checksum_of_all_data_tells_of_any_changed_message() -> None:
    data = build(ROWS, chunked=False, options={"enable_data_crcs": True})
    assert from_pieces([data]).damage == ""
    for _, start, end in [found for found in records(data) if found[0] == MESSAGE][::7]:
        bad = bytearray(data)
        bad[end - 3] ^= 1
        for pieces in ([bytes(bad)], cut(bytes(bad), 11), cut(bytes(bad), start)):
            assert from_pieces(pieces).told


@pytest.mark.parametrize("compression", ["none", "zstd", "lz4"])
def test_a_damaged_chunk_says_where_it_is(compression: str) -> None:
    data = bytearray(small(compression, chunked=True))
    _, start, end = [found for found in records(bytes(data)) if found[0] == CHUNK][2]
    data[start + 9 + 24] ^= 1  # its checksum
    got = from_pieces([bytes(data)])
    assert got.texts == [f"chunk at byte {start}, {end - start} bytes: checksum wrong, skipped"]
    assert (got.damage, got.lines["unreadable"]) == ("", 1)
    assert is_part(got.frames, ROWS)
    assert len(got.frames) < len(ROWS)


def test_definitions_of_a_damaged_chunk(tmp_path: Path) -> None:
    """From the summary of a file; of a pipe from the damaged chunk itself, as far as it can be unpacked."""
    for compression in ("none", "zstd", "lz4"):
        data = bytearray(small(compression, chunked=True))
        _, start, end = next(found for found in records(bytes(data)) if found[0] == CHUNK)
        data[start + 9 + 24] ^= 1
        assert from_pieces([bytes(data)]).frames == from_file(tmp_path / "x", bytes(data)).frames != []
        data[start + 9 + 40 + 8 : end] = bytes(end - start - 57)  # nothing is left of it
        assert from_file(tmp_path / "x", bytes(data)).frames == from_file(tmp_path / "x", bytes(data)).frames != []
        got = from_pieces([bytes(data)])
        assert got.frames == []
        assert got.texts[1] == "message of channel 1: nothing says what it holds"


@pytest.mark.parametrize("chunked", [True, False])
def test_what_the_file_counts_and_is_not_there(chunked: bool) -> None:
    """A record that becomes a private one by its highest bit is missed at the end; nothing is when more is told."""
    data = small("none", chunked)
    kind, lost = (CHUNK, 10) if chunked else (MESSAGE, 1)
    start = [start for opcode, start, _ in records(data) if opcode == kind][2]
    place = next(start for opcode, start, _ in records(data) if opcode == STATISTICS)
    bad = bytearray(data)
    bad[start] ^= 0x80
    for pieces in ([bytes(bad)], cut(bytes(bad), 100)):
        got = from_pieces(pieces)
        told = f"byte {place}: the file counts 40 messages, {len(got.frames)} were found"
        assert (got.damage, got.texts, got.notes[-1]) == (told, [], "private records skipped: 1")
        assert len(got.frames) >= 40 - lost
    got = from_pieces([junk(bytes(bad), start, b"\0")])
    assert (got.damage, len(got.texts)) == ("", 1)


def test_a_chunk_without_messages_that_is_not_there() -> None:
    data = bytearray(small("none", chunked=True))
    place = next(start for opcode, start, _ in records(bytes(data)) if opcode == STATISTICS)
    data[place + 9 + 22] += 1
    assert from_pieces([bytes(data)]).damage == f"byte {place}: the file counts 6 chunks, 5 were found"


def test_a_file_without_statistics() -> None:
    data = build(ROWS, chunk_size=700, options={"use_statistics": False})
    start = next(start for opcode, start, _ in records(data) if opcode == CHUNK)
    bad = bytearray(data)
    bad[start] ^= 0x80
    assert from_pieces([bytes(bad)]).damage == ""
    assert not from_pieces([data]).told


def junk(data: bytes, at: int, what: bytes) -> bytes:
    return data[:at] + what + data[at:]


@pytest.mark.sampled(2)
@pytest.mark.parametrize("chunked", [True, False])
@pytest.mark.parametrize("size", [1, 3, 9, 500, 5000])
def test_bytes_that_are_no_records_are_skipped(size: int, chunked: bool) -> None:
    data = small("none", chunked)
    starts = [start for opcode, start, _ in records(data) if opcode == (CHUNK if chunked else MESSAGE)]
    for what in (bytes(size), b"\xff" * size, random.Random(size).randbytes(size)):
        bad = junk(data, starts[2], what)
        got = from_pieces([bad])
        assert (got.frames, got.damage) == (ROWS, "")
        assert got.texts == [f"no MCAP record at byte {starts[2]}: {size} bytes skipped"]
        for length in (1, 7, 1000):
            assert from_pieces(cut(bad, length)) == got


def test_messages_of_channels_that_are_not_there_are_no_place_to_go_on() -> None:
    foreign = HEAD.pack(MESSAGE, 30) + struct.pack("<H", 999) + bytes(28)
    what = b"\0" + foreign * 9
    data = small("none", chunked=False)
    start = [start for opcode, start, _ in records(data) if opcode == MESSAGE][2]
    got = from_pieces([junk(data, start, what)])
    assert got.frames == ROWS
    assert got.texts == [f"no MCAP record at byte {start}: {len(what)} bytes skipped"]


def test_nothing_but_junk() -> None:
    got = from_pieces([mcaps.build([])[:8] + random.Random(1).randbytes(100_000)])
    assert got.damage == "byte 8: no MCAP record from here on"
    assert (from_pieces([b"\x89MCAP0\r\n"]).damage, got.frames) == ("byte 8: MCAP data ends early", [])


HUGE = [0xFFFF_FFFF_FFFF_FFFF, 1 << 63, 1 << 40, (1 << 28) + 1, 1 << 27, 100_000, 21, 1, 0]


@pytest.mark.sampled(2)
@pytest.mark.parametrize("length", HUGE)
@pytest.mark.parametrize("chunked", [True, False])
def test_lengths_that_lie(length: int, chunked: bool) -> None:
    """The length of each record in turn."""
    data = small("none", chunked)
    for opcode, start, _ in records(data):
        bad = bytearray(data)
        bad[start + 1 : start + 9] = struct.pack("<Q", length)
        got = from_pieces([bytes(bad)])
        assert got.told or HEAD.unpack_from(data, start)[1] == length
        if opcode == MESSAGE or chunked:
            assert len([row for row in got.frames if row in ROWS]) >= len(ROWS) - 9


def chunk(size: int, compression: bytes, stored: bytes, crc: int = 0) -> bytes:
    head = struct.pack("<QQQII", 0, 0, size, crc, len(compression)) + compression + struct.pack("<Q", len(stored))
    return HEAD.pack(CHUNK, len(head) + len(stored)) + head + stored


BOMB = bytes(512 << 20)
BOMBS = {b"zstd": zstandard.compress(BOMB), b"lz4": lz4.frame.compress(BOMB)}


@pytest.mark.parametrize("packing", BOMBS)
@pytest.mark.parametrize("size", [0, 100, 1 << 20, 512 << 20, 1 << 60])
def test_bombs(packing: bytes, size: int) -> None:
    data = small("zstd", chunked=True)
    start = [start for opcode, start, _ in records(data) if opcode == CHUNK][1]
    for stored in (BOMBS[packing], BOMBS[packing][:-100]):
        tracemalloc.start()
        got = from_pieces([junk(data, start, chunk(size, packing, stored))])
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert got.frames == ROWS
        assert got.lines["unreadable"] == 1
        assert peak < 16 << 20


def test_compressions_that_nobody_knows() -> None:
    data = small("none", chunked=True)
    start = [start for opcode, start, _ in records(data) if opcode == CHUNK][1]
    got = from_pieces([junk(data, start, chunk(5, b"br\x1botli", b"12345"))])
    assert got.frames == ROWS
    assert got.texts == [f"chunk at byte {start}, 61 bytes: compression 'br\\x1botli' not known, skipped"]


def test_records_of_other_kinds() -> None:
    """Unknown ones of the format are told, those of applications noted."""
    data = small("none", chunked=True)
    start = [start for opcode, start, _ in records(data) if opcode == CHUNK][1]
    got = from_pieces([junk(data, start, HEAD.pack(0x90, 5) + b"12345")])
    assert (got.frames, got.texts, got.notes[-1]) == (ROWS, [], "private records skipped: 1")
    got = from_pieces([junk(data, start, HEAD.pack(0x11, 5) + b"12345")])
    assert got.frames == ROWS
    assert got.texts == [f"record at byte {start}, 14 bytes: kind 0x11 not known, skipped"]
    builder = Builder()
    builder.writer.add_attachment(0, 0, "file", "text/plain", bytes(100_000))
    builder.writer.add_metadata("meta", {"a": "b"})
    for row in ROWS:
        builder.add("/x", LAYOUTS["can_msgs"], row)
    got = from_pieces(cut(builder.bytes(), 999))
    assert (got.frames, got.told) == (ROWS, False)


def test_records_longer_than_the_limit_pass_through() -> None:
    """An attachment of 300 MiB, and a chunk: neither is held in memory."""
    data, block, size = small("none", chunked=True), bytes(1 << 20), 300 << 20
    start = [start for opcode, start, _ in records(data) if opcode == CHUNK][1]
    attachment = HEAD.pack(9, 36 + size) + struct.pack("<QQIIQ", 0, 0, 0, 0, size)
    long_chunk = HEAD.pack(CHUNK, 40 + size) + struct.pack("<QQQIIQ", 0, 0, size, 0, 0, size)
    told = f"record at byte {start}, {49 + size} bytes: a chunk too long, skipped"
    for head, tail, texts in ((attachment, bytes(4), []), (long_chunk, b"", [told])):
        tracemalloc.start()
        got = from_pieces([data[:start] + head, *[block] * 300, tail + data[start:]])
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert (got.frames, got.damage, got.texts) == (ROWS, "", texts)
        assert peak < 8 << 20


@pytest.mark.parametrize("behind", [b"x", mcaps.build([])])
def test_data_behind_the_end(behind: bytes) -> None:
    data = small("lz4", chunked=True)
    for pieces in ([data + behind], [data, behind], cut(data + behind, 50)):
        got = from_pieces(pieces)
        assert got.frames == ROWS
        assert got.damage == f"byte {len(data)}: data behind the end of the MCAP data"
