"""MCAP files that ask for far more work than they are worth: it is bounded, and ends when that is asked for."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Any

import lz4.frame
import pytest
import zstandard
from kit.mcaps import LAYOUTS, Frame, Got, build, frames, from_pieces

from analyzer.sources import Source
from analyzer.sources.mcap import contents, read, reader
from analyzer.sources.mcap.chunks import Chunk
from analyzer.sources.mcap.effort import Effort
from analyzer.sources.mcap.search import PLACES, ROUND, Found, Result, find

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

ROWS = frames(40)
MIB = 1 << 20
CHUNK, MESSAGE, CHANNEL, SCHEMA = 6, 5, 4, 3
HEAD = struct.Struct("<BQ")
PACK: dict[str, Callable[[bytes], bytes]] = {"zstd": zstandard.compress, "lz4": lz4.frame.compress, "": bytes}
# A file without chunks; those that a test puts in front of its first message are counted nowhere.
WHOLE = build(ROWS, chunked=False, options={"use_statistics": False})
FIRST = WHOLE.index(HEAD.pack(MESSAGE, 22 + len(LAYOUTS["can_msgs"].write(ROWS[0]))))


def record(opcode: int, body: bytes) -> bytes:
    return HEAD.pack(opcode, len(body)) + body


def chunk(data: bytes, packing: str = "zstd") -> bytes:
    stored, name = PACK[packing](data), packing.encode()
    head = struct.pack("<QQQII", 0, 0, len(data), 0, len(name)) + name + struct.pack("<Q", len(stored))
    return record(CHUNK, head + stored)


def message(frame: Frame, channel: int = 1) -> bytes:
    return record(MESSAGE, struct.pack("<HIQQ", channel, 0, frame.t, frame.t) + LAYOUTS["can_msgs"].write(frame))


def channel(topic: bytes) -> bytes:
    text = [struct.pack("<I", len(part)) + part for part in (topic, b"cdr")]
    return record(CHANNEL, struct.pack("<HH", 9, 7) + b"".join(text) + bytes(4))


def amid(*chunks: bytes) -> Got:
    """What is read of a file with chunks in front of its first message, and nothing else wrong; all rows are there."""
    got = from_pieces([WHOLE[:FIRST] + b"".join(chunks) + WHOLE[FIRST:]])
    assert got.frames == ROWS
    return got


class Counted:
    """Rounds of searches, passed on to the real one."""

    def __init__(self) -> None:
        self.rounds = self.places = self.bytes = 0

    def __call__(self, data: bytes, start: int, known: Any, *, final: bool) -> Found:
        found = find(data, start, known, final=final)
        self.rounds += 1
        self.places += found.places
        self.bytes += found.at - start
        return found


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> Counted:
    count = Counted()
    monkeypatch.setattr(contents, "find", count)
    monkeypatch.setattr(reader, "find", count)
    return count


DENSE = bytes([2] * 5) + bytes(8)


@pytest.mark.slow
@pytest.mark.parametrize("garbage", [bytes(1), DENSE, HEAD.pack(MESSAGE, 22), HEAD.pack(4, 99) + b"\0\0"])
def test_a_chunk_of_garbage_is_given_up(counted: Counted, garbage: bytes) -> None:
    size = 128 * MIB // len(garbage) * len(garbage)
    got = amid(chunk(b"\0" + garbage * (size // len(garbage))))
    assert len(got.texts) == 1
    assert got.texts[0].endswith(f"no record at byte 0 of its data, {size + 1} bytes skipped, not all of them searched")
    assert counted.places < 1 << 20
    assert counted.bytes < 40 * MIB


@pytest.mark.slow
def test_garbage_that_is_stored_as_such_is_searched_to_its_end(counted: Counted) -> None:
    """It cannot be more than the file: records behind it are found."""
    size = 48 * MIB
    got = from_pieces([WHOLE[:FIRST] + chunk(bytes(size) + message(ROWS[0]) * 5, "") + WHOLE[FIRST:]])
    assert got.frames == [ROWS[0]] * 5 + ROWS
    assert got.texts[0].endswith(f"{size} bytes skipped")
    assert counted.bytes >= size - 1


@pytest.mark.sampled(4)
@pytest.mark.parametrize(
    "part",
    [
        message(ROWS[0], 77),
        b"\0" + message(ROWS[0]) * 4,
        b"\0" + channel(b"/x") + channel(b"/y"),
        channel(b"/x") + channel(b"/y"),
        record(0x20, b""),
    ],
)
def test_records_that_cost_much_are_given_up(part: bytes) -> None:
    data = part * (40 * MIB // len(part))
    got = from_pieces([WHOLE[:FIRST] + chunk(data) + WHOLE[FIRST:]])
    assert got.frames[-40:] == ROWS
    assert got.lines["unreadable"] < 200_000
    assert any("more work than a file of this size is worth" in text for text in got.texts[-2:])


@pytest.mark.slow
def test_a_damaged_chunk_of_many_definitions(monkeypatch: pytest.MonkeyPatch) -> None:
    data, asked = bytearray(chunk(channel(b"/x") * 500_000)), 0
    data[9 + 24] = 1  # its checksum
    goes_on = contents.Contents._goes_on

    def count(self: contents.Contents) -> bool:
        nonlocal asked
        asked += 1
        return goes_on(self)

    monkeypatch.setattr(contents.Contents, "_goes_on", count)
    assert amid(bytes(data)).lines["unreadable"] == 1
    assert 100 < asked < 200_000


def test_a_schema_counts_by_its_size() -> None:
    """Once; a file that is all schemas is worth reading them."""
    text = struct.pack("<I", MIB) + bytes(MIB)
    schema = b"".join(
        record(SCHEMA, struct.pack("<H", number) + bytes(8) + text)
        + record(CHANNEL, struct.pack("<HH", number, number) + bytes(12))
        for number in range(10, 40)
    )
    assert not amid(chunk(schema, "")).told
    got = amid(chunk(schema))
    assert [text.partition(": ")[2].partition(", skipped")[0] for text in got.texts] == [
        "more work than a file of this size is worth"
    ] * 2


@pytest.mark.slow
@pytest.mark.parametrize("packing", ["zstd", "lz4"])
def test_chunks_that_unpack_to_absurdly_much(packing: str) -> None:
    """Once 256 MiB have been unpacked for nearly nothing; small chunks count like large ones."""
    for size in (100 * MIB, 16 * MIB):
        one = chunk(bytes(size), packing)
        got = amid(*[one] * (300 * MIB // size))
        refused = [text for text in got.texts if text.endswith("absurdly much for a file of this size, skipped")]
        assert len(refused) == (len(got.texts) - 256 * MIB // size if packing == "zstd" else 0)
        assert len(got.texts) == 300 * MIB // size


@pytest.mark.slow
def test_much_of_the_same_passes() -> None:
    """Frames that are alike but for their times, and frames without any: longer than what is unpacked at once."""
    alike = [Frame(10**18 + k * 10**6, 5, b"12345678") for k in range(240_000)]
    for rows in (alike, [Frame(0, 5, b"12345678")] * 240_000):
        data = b"".join(map(message, rows))
        assert len(data) > 16 * MIB
        for packing in ("zstd", "lz4"):
            got = from_pieces([WHOLE[:FIRST] + chunk(data, packing) + WHOLE[FIRST:]])
            assert (got.told, len(got.frames)) == (False, len(rows) + len(ROWS))
            assert got.frames[-41] == Frame(rows[-1].t, 5, b"12345678")


def test_what_a_file_is_worth() -> None:
    effort = Effort()
    assert effort.unpack(256 * MIB)
    assert not effort.unpack(1)
    effort.read = 1000
    assert effort.unpack(10**6)
    assert not effort.unpack(1)
    assert effort.spend(1 << 19)
    assert effort.spend(500)
    assert not effort.spend(1)


@pytest.mark.slow
def test_a_round_is_short() -> None:
    """Whatever stands there; where it goes on nothing is left out."""
    for data in (bytes(3 * ROUND + 5), DENSE * (ROUND // 5), bytes(2 * ROUND - 4) + WHOLE[FIRST:]):
        at, rounds = 0, 0
        while (found := find(data, at, {1}, final=True)).result is Result.ONWARD:
            assert at < found.at <= at + ROUND
            assert found.places <= PLACES
            at, rounds = found.at, rounds + 1
        assert rounds
        assert (found.at, found.result) == (
            (2 * ROUND - 4, Result.FOUND) if data.startswith(b"\0") and data[-1] else (len(data), Result.NOTHING)
        )


@pytest.mark.parametrize("packed", [True, False])
def test_a_search_ends_when_the_reading_is_stopped(monkeypatch: pytest.MonkeyPatch, packed: bool) -> None:
    source, count = Source("-"), Counted()

    def stop(*args: Any, **more: Any) -> Found:
        source.stopped = count.rounds == 2
        return count(*args, **more)

    monkeypatch.setattr(contents, "find", stop)
    monkeypatch.setattr(reader, "find", stop)
    garbage = DENSE * 10_000
    got = Got(source, read(source, iter([WHOLE[:FIRST] + (chunk(garbage) if packed else b"\0" + garbage)])))
    assert count.rounds == 3
    assert (got.damage, got.lines["unreadable"]) == ("", 0)


@pytest.mark.parametrize("packing", ["zstd", "lz4"])
def test_unpacking_ends_when_the_reading_is_stopped(packing: str) -> None:
    data, asked = bytes(64 * MIB), 0

    def stopped() -> bool:
        nonlocal asked
        asked += 1
        return asked == 3

    stored = PACK[packing](data)
    got, _ = Chunk(len(data), 0, packing, 0, len(stored)).records(stored, stopped)
    assert asked == 3
    assert 0 < len(got) <= 3 << 17
    assert Chunk(len(data), 0, packing, 0, len(stored)).records(stored, lambda: False) == (data, "")


def test_messages_that_say_nothing_end_when_the_reading_is_stopped(monkeypatch: pytest.MonkeyPatch) -> None:
    source, asked = Source("-"), 0
    settle = contents.Channels.settle

    def stop(self: contents.Channels, number: int, body: bytes) -> bool:
        nonlocal asked
        asked += number == 77
        source.stopped = asked > 2
        return settle(self, number, body)

    monkeypatch.setattr(contents.Channels, "settle", stop)
    Got(source, read(source, iter([WHOLE[:FIRST] + chunk(message(ROWS[0], 77) * 1000)])))
    assert asked < 6


def test_a_pipe_that_is_stopped_is_read_as_far_as_it_came() -> None:
    source = Source("-")
    source.live = source.stopped = True

    def pieces() -> Iterator[bytes]:
        yield WHOLE[: FIRST + 500]
        yield WHOLE[FIRST + 500 :]

    assert Got(source, read(source, pieces())).frames == ROWS
    source = Source("-")
    source.stopped = True
    assert Got(source, read(source, pieces())).frames == []
