"""MCAP as others read it: file structure by the mcap package with all checksums, messages by the rules of CDR."""

from __future__ import annotations

import io
import re
import struct
import tracemalloc
import zlib
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit.rows import (
    BRS,
    CAPTURES,
    ESI,
    EXTENDED,
    FD,
    REMOTE,
    RX,
    TX,
    Fault,
    Frame,
    Record,
    piece,
    records,
    sound,
    written,
)
from mcap.reader import NonSeekingReader, make_reader
from mcap.records import Chunk, ChunkIndex, Message, MessageIndex
from mcap.stream_reader import StreamReader, breakup_chunk

from analyzer._native import Rows
from analyzer.sinks import COMPRESSIONS, open_sink
from analyzer.sinks.mcap import CHUNK
from analyzer.sources import Source
from analyzer.sources.native import rows

if TYPE_CHECKING:
    from pathlib import Path

NS = 1_700_000_000_123_456_789


class Cdr:
    """Little-endian plain CDR: every number is aligned to its size, counted from behind the encapsulation."""

    def __init__(self, data: bytes) -> None:
        assert data[:4] == b"\x00\x01\x00\x00"
        self.data, self.at = data[4:], 0

    def take(self, code: str) -> Any:
        size = struct.calcsize(code)
        self.at += -self.at % size
        (value,) = struct.unpack_from("<" + code, self.data, self.at)
        self.at += size
        return value

    def raw(self, size: int) -> bytes:
        self.at += size
        return self.data[self.at - size : self.at]


def message(schema: str, data: bytes) -> dict[str, Any]:
    """The fields in the order in which the definition has them; nothing may be left."""
    cdr = Cdr(data)
    out: dict[str, Any] = {"stamp": (cdr.take("i"), cdr.take("I"))}
    name = cdr.raw(cdr.take("I"))
    assert name.endswith(b"\0")
    out |= {"bus": name[:-1].decode(), "id": cdr.take("I")}
    if schema == "can_msgs/msg/Frame":
        out |= {field: cdr.take("?") for field in ("is_rtr", "is_extended", "is_error")}
        out |= {"dlc": cdr.take("B"), "data": cdr.raw(8)}
    else:
        assert schema == "ros2_socketcan_msgs/msg/FdFrame"
        out |= {field: cdr.take("?") for field in ("is_extended", "is_error")}
        out |= {"len": cdr.take("B"), "data": cdr.raw(cdr.take("I"))}
    assert cdr.at == len(cdr.data)
    return out


def messages(data: bytes) -> list[tuple[str, int, dict[str, Any]]]:
    """Topic, time and fields of every message, in the order of the file."""
    reader = NonSeekingReader(io.BytesIO(data), validate_crcs=True)
    found = []
    for schema, channel, sent in reader.iter_messages(log_time_order=False):
        assert schema is not None
        assert (schema.encoding, channel.message_encoding) == ("ros2msg", "cdr")
        assert sent.publish_time == sent.log_time
        found.append((channel.topic, sent.log_time, message(schema.name, sent.data)))
    return found


def test_the_messages() -> None:
    capture = [
        Frame(NS, "can0", 0x123, RX, b"\x01\x02"),
        Frame(NS + 1, "can0", 0x1234567, EXTENDED | TX, bytes(range(8))),
        Frame(NS + 2, "can0", 0x7FF, FD | BRS | ESI | RX, bytes(range(12))),
        Frame(NS + 3, "a/b", 0, REMOTE, b"", 5),
        Fault(NS + 4, "can0", 0x204, b"\x00\x0c"),
        Fault(NS + 5, "can0", 4, b"", TX),
        Frame(None, "can0", 1, 0, b""),
        Frame(2**31 * 10**9 + 5, "can0", 1, TX | FD, b""),
    ]
    stamps = [(1_700_000_000, 123_456_789 + k) for k in range(6)]
    classic: dict[str, Any] = {"is_rtr": False, "is_extended": False, "is_error": False}
    flexible: dict[str, Any] = {"is_extended": False, "is_error": False}
    assert messages(written("mcap", [piece(capture)])[0]) == [
        ("/can0/from_can_bus", NS, {"stamp": stamps[0], "bus": "can0", "id": 0x123, **classic, "dlc": 2,
         "data": b"\x01\x02\0\0\0\0\0\0"}),
        ("/can0/to_can_bus", NS + 1, {"stamp": stamps[1], "bus": "can0", "id": 0x1234567, **classic,
         "is_extended": True, "dlc": 8, "data": bytes(range(8))}),
        ("/can0/from_can_bus_fd", NS + 2, {"stamp": stamps[2], "bus": "can0", "id": 0x7FF, **flexible, "len": 12,
         "data": bytes(range(12))}),
        ("/a_b/can", NS + 3, {"stamp": stamps[3], "bus": "a/b", "id": 0, **classic, "is_rtr": True, "dlc": 5,
         "data": bytes(8)}),
        ("/can0/can", NS + 4, {"stamp": stamps[4], "bus": "can0", "id": 0x204, **classic, "is_error": True,
         "dlc": 2, "data": b"\x00\x0c\0\0\0\0\0\0"}),
        ("/can0/to_can_bus", NS + 5, {"stamp": stamps[5], "bus": "can0", "id": 4, **classic, "is_error": True,
         "dlc": 0, "data": bytes(8)}),
        ("/can0/untimed/can", NS + 5, {"stamp": (0, 0), "bus": "can0", "id": 1, **classic, "dlc": 0,
         "data": bytes(8)}),
        ("/can0/to_can_bus_fd", 2**31 * 10**9 + 5, {"stamp": (0, 0), "bus": "can0", "id": 1, **flexible, "len": 0,
         "data": b""}),
    ]  # fmt: skip


def test_frames_without_a_time_have_channels_that_say_so() -> None:
    """Their log time is none of theirs: the first one that there is, or the last one before them."""
    capture = [Fault(None), Frame(NS, "a/b", flags=RX), Frame(None, "a/b", flags=RX | FD), Frame(NS + 9)]
    data, _ = written("mcap", [piece(capture)])
    summary = make_reader(io.BytesIO(data)).get_summary()
    assert {channel.topic: channel.metadata for channel in summary.channels.values()} == {
        "/can0/untimed/can": {"bus": "can0", "times": "none"},
        "/a_b/from_can_bus": {"bus": "a/b"},
        "/a_b/untimed/from_can_bus_fd": {"bus": "a/b", "frames": "CAN FD", "times": "none"},
        "/can0/can": {"bus": "can0"},
    }
    assert [(t, fields["stamp"]) for _, t, fields in messages(data)] == [
        (NS, (0, 0)), (NS, divmod(NS, 10**9)), (NS, (0, 0)), (NS + 9, divmod(NS + 9, 10**9)),
    ]  # fmt: skip
    assert (summary.statistics.message_start_time, summary.statistics.message_end_time) == (NS, NS + 9)


def test_the_definitions_are_complete() -> None:
    data, _ = written("mcap", [piece([Frame(), Frame(flags=FD)])])
    for schema in make_reader(io.BytesIO(data)).get_summary().schemas.values():
        own, *parts = re.split(r"=+\nMSG: (\S+)\n", schema.data.decode())
        known = {"uint8", "uint32", "int32", "bool", "string", *parts[::2]}
        for line in "".join([own, *parts[1::2]]).splitlines():
            kind, _ = line.split()
            assert re.sub(r"\[.*\]", "", kind) in known | {name.split("/")[-1] for name in known}, line


LONG = [
    Frame(
        NS + 1000 * k, f"can{k % 2 + (2 if k > 40_000 else 0)}", k % 0x800, (RX, TX)[k % 3 == 0], k.to_bytes(8, "big")
    )
    for k in range(60_000)
]


@pytest.mark.slow
@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_long_captures_can_be_searched(compression: str) -> None:
    made = Rows()
    data, sink = written(
        "mcap", [piece(LONG[at : at + 25_000], made) for at in range(0, len(LONG), 25_000)], compression
    )
    assert sink.frames == len(LONG)
    assert records(sound("mcap", data)) == LONG
    reader = make_reader(io.BytesIO(data), validate_crcs=True)
    summary = reader.get_summary()
    statistics = summary.statistics
    assert (statistics.message_count, statistics.schema_count, statistics.channel_count) == (len(LONG), 1, 8)
    assert (statistics.message_start_time, statistics.message_end_time) == (LONG[0].t, LONG[-1].t)
    assert sum(statistics.channel_message_counts.values()) == len(LONG)
    assert statistics.chunk_count == len(summary.chunk_indexes) > 3
    assert {index.compression for index in summary.chunk_indexes} == {"" if compression == "none" else compression}
    assert all(CHUNK <= index.uncompressed_size <= CHUNK + 2000 for index in summary.chunk_indexes[:-1])
    middle = LONG[30_000].t
    assert middle is not None
    found = reader.iter_messages(topics=["/can0/from_can_bus"], starting_at=middle, ending_before=middle + 10_000)
    wanted = [frame.t for frame in LONG[30_000:30_010] if (frame.bus, frame.flags) == ("can0", RX)]
    assert [sent.log_time for _, _, sent in found] == wanted


@given(capture=CAPTURES, flushed=st.sets(st.integers(0, 29)))
def test_the_indexes_of_any_capture(capture: list[Record], flushed: set[int]) -> None:
    file, made = io.BytesIO(), Rows()
    sink = open_sink("mcap", file, compression="none")
    for at, record in enumerate(capture):
        sink.write(piece([record], made))
        if at in flushed:
            sink.flush()
    sink.close()
    data = file.getvalue()
    chunk: Chunk | None = None
    chunks = indexed = 0
    for found in StreamReader(io.BytesIO(data), emit_chunks=True, validate_crcs=True).records:
        if isinstance(found, Chunk):
            chunk, chunks = found, chunks + 1
            assert zlib.crc32(found.data) == found.uncompressed_crc
            times = [part.log_time for part in breakup_chunk(found) if isinstance(part, Message)]
            assert (min(times), max(times)) == (found.message_start_time, found.message_end_time)
        elif isinstance(found, MessageIndex):
            assert chunk is not None
            indexed += len({at for _, at in found.records})
            for t, at in found.records:
                assert struct.unpack_from("<BQHIQ", chunk.data, at)[::2] == (5, found.channel_id, t)
        elif isinstance(found, ChunkIndex):
            assert data[found.chunk_start_offset] == 6
            for channel, at in found.message_index_offsets.items():
                assert struct.unpack_from("<BQH", data, at)[::2] == (7, channel)
    statistics = make_reader(io.BytesIO(data)).get_summary().statistics
    assert statistics.message_count == indexed == len(capture) == len(messages(data))
    ends = {at for at in flushed if at < len(capture)} | ({len(capture) - 1} if capture else set())
    assert statistics.chunk_count == chunks == len(ends)


def test_what_is_flushed_is_there_after_a_crash(tmp_path: Path) -> None:
    file, made = io.BytesIO(), Rows()
    sink = open_sink("mcap", file)
    frames = [Frame(NS + k, f"can{k}") for k in range(10)]
    sink.write(piece(frames[:5], made))
    sink.flush()
    sink.write(piece(frames[5:], made))
    path = tmp_path / "cut.mcap"
    path.write_bytes(file.getvalue())
    source = Source(str(path))
    assert records(part for part in rows(source.chunks()) if not isinstance(part, bytes)) == frames[:5]
    assert source.damage is not None


def test_the_summary_has_a_checksum() -> None:
    data, _ = written("mcap", [piece([Frame()])])
    (start, _, crc), magic = struct.unpack("<QQI", data[-28:-8]), data[-8:]
    assert (crc, magic) == (zlib.crc32(data[start:-12]), data[:8])


def test_an_empty_capture_is_a_file() -> None:
    data, _ = written("mcap", [])
    assert messages(data) == []
    assert make_reader(io.BytesIO(data)).get_summary().statistics.message_count == 0


@given(names=st.lists(st.text(min_size=1, max_size=40), max_size=10, unique=True))
def test_topics(names: list[str]) -> None:
    made = piece([Frame(bus=name) for name in names])
    channels = make_reader(io.BytesIO(written("mcap", [made])[0])).get_summary().channels
    topics = [channels[number].topic for number in sorted(channels)]
    assert len(set(topics)) == len(topics) == len(made.buses)
    assert all(re.fullmatch(r"/[A-Za-z_][A-Za-z0-9_]*/can", topic) for topic in topics)
    plain = {f"/{name}/can" for name in made.buses if re.fullmatch(r"[A-Za-z][A-Za-z0-9]*", name)}
    assert plain <= set(topics)


def test_numbers_and_doubles_among_names() -> None:
    made = piece([Frame(bus=name) for name in ("0", "a b", "a/b", "a_b", "a_b_2", "é")])
    channels = make_reader(io.BytesIO(written("mcap", [made])[0])).get_summary().channels
    assert [channels[number].topic for number in sorted(channels)] == [
        f"/{part}/can" for part in ("bus_0", "a_b", "a_b_2", "a_b_3", "a_b_2_2", "_xc3_xa9")
    ]


@pytest.mark.slow
def test_a_recording_of_days_takes_little_memory() -> None:
    """Two chunks a second, with three channels each: what the summary needs is kept in few bytes."""

    class Nowhere(io.BytesIO):
        def write(self, data: Any) -> int:
            return len(data)

    sink = open_sink("mcap", Nowhere(), compression="none")

    def record(first: int, count: int) -> None:
        for n in range(first, first + count):
            t = NS + n * 500_000_000
            frames = [Frame(t + k * 1_234_567, "can0" if k % 3 else "can1", n, RX * (k % 2)) for k in range(6 + n % 7)]
            sink.write(piece(frames))
            sink.flush()

    record(0, 500)
    tracemalloc.start()
    record(500, 500)
    before, _ = tracemalloc.get_traced_memory()
    record(1000, 4000)
    after, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert (after - before) / 4000 < 40
