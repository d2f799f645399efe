"""MCAP files that are sound: the same rows from every layout, compression and way to write them."""

from __future__ import annotations

import gzip
import json
from io import BytesIO
from typing import TYPE_CHECKING

import pytest
import zstandard
from kit import mcaps
from kit.mcaps import EXTENDED, FD, LAYOUTS, Builder, Frame, Got, Layout, build, frames, from_file
from mcap.reader import NonSeekingReader

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Read = Callable[[bytes], Got]

ROWS = frames(300)
TX, RX = 64, 128
MIXED = [
    Frame(10**18, 0x7FF, b"\1\2", "vcan0", 0),
    Frame(10**18 + 1, 0, b"", "vcan0", 0),
    Frame(10**18 + 2, 0x1FFF_FFFF, bytes(8), "can1"),
    Frame(10**18 + 999_999_999, 0x12, bytes(range(8)), "can1"),
]


@pytest.fixture
def read(tmp_path: Path) -> Read:
    return lambda data: from_file(tmp_path / "x.mcap", data)


@pytest.mark.parametrize("chunked", [True, False])
@pytest.mark.parametrize("compression", mcaps.COMPRESSIONS)
@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_layout_gives_the_same_rows(read: Read, layout: str, compression: str, chunked: bool) -> None:
    got = read(build(ROWS, layout, compression=compression, chunked=chunked, chunk_size=4000))
    assert got.frames == ROWS
    assert (got.damage, got.texts, got.lines["frames"]) == ("", [], len(ROWS))
    timed = "log_time" if "json" in layout else "the message's own" if layout == "protobuf" else "header.stamp"
    assert got.notes[-1] == f"time is {timed}"


@pytest.mark.parametrize("layout", [name for name in LAYOUTS if "json" not in name])
def test_flags_and_buses_of_the_messages(read: Read, layout: str) -> None:
    assert read(build(MIXED, layout)).frames == MIXED


@pytest.mark.parametrize("pack", [gzip.compress, zstandard.compress])
def test_inside_another_compression(read: Read, pack: Callable[[bytes], bytes]) -> None:
    data = build(ROWS, compression="lz4")
    got = read(pack(data))
    assert (got.frames, got.damage) == (ROWS, "")
    got = read(pack(data[:-400]))
    assert got.frames == ROWS
    assert got.damage.endswith("of the unpacked data: MCAP data ends early, no message is missing")


def test_the_package_itself_reads_the_same(read: Read) -> None:
    """The oracle: messages in file order, several channels of several layouts."""
    builder = Builder("zstd", chunk_size=3000)
    for number, frame in enumerate(frames(500, buses=("a", "b", "c"))):
        builder.add(f"/can{number % 3}/rx", LAYOUTS[("can_msgs", "json", "protobuf")[number % 3]], frame)
    data = builder.bytes()
    times = [message.log_time for _, _, message in NonSeekingReader(BytesIO(data)).iter_messages(log_time_order=False)]
    got = read(data)
    assert [frame.t for frame in got.frames] == times
    assert got.frames == frames(500, buses=("a", "b", "c"))
    assert "time is header.stamp or own, log_time for 167 messages" in got.notes


def test_names_of_buses_without_their_own(read: Read) -> None:
    builder = Builder()
    topics = ["/can0/rx", "/can0/tx", "/truck/can1/frames", "/can/raw", "/can/frame", "/from_can_bus", "can0/raw", "/"]
    nameless = [Frame(k + 1, 5, b"", "", 0) for k in range(len(topics))]
    for topic, frame in zip(topics, nameless, strict=True):
        builder.add(topic, LAYOUTS["can_msgs"], frame)
    names = [frame.bus for frame in read(builder.bytes()).frames]
    assert names == ["can0", "can0", "truck/can1", "can", "can/frame", "from_can_bus", "can0/raw", "can"]


def test_a_name_that_every_driver_writes_is_none(read: Read) -> None:
    builder = Builder()
    for bus in "12":
        builder.add(f"/can{bus}/from_can_bus", LAYOUTS["can_msgs"], Frame(1, 5, b"", "can", 0))
    assert [frame.bus for frame in read(builder.bytes()).frames] == ["can1", "can2"]


def test_direction_by_topic(read: Read) -> None:
    builder = Builder()
    for part in ("from_can_bus", "to_can_bus", "from_can_bus_fd", "to_can_bus_fd", "rx"):
        builder.add(f"/can0/{part}", LAYOUTS["can_msgs"], Frame(1, 5, b"", "can0", 0))
    assert [frame.flags for frame in read(builder.bytes()).frames] == [RX, TX, RX, TX, 0]


def test_can_fd_where_the_message_does_not_say(read: Read) -> None:
    """Long frames, and later ones of their identifier; in a file of our own, which names the bus, all of them."""
    rows = [Frame(1, number, bytes(size), "can0", EXTENDED) for number, size in ((1, 8), (1, 12), (1, 8), (2, 8))]
    assert [frame.flags & FD for frame in read(build(rows, "fd")).frames] == [0, FD, FD, 0]
    assert [frame.flags & FD for frame in read(build(rows, "fd", metadata={"frames": "CAN FD"})).frames] == [FD] * 4
    nameless = [Frame(1, 1, b"", "", 0)]
    assert [frame.bus for frame in read(build(nameless, metadata={"bus": "x y"})).frames] == ["x y"]


def test_messages_without_a_time_have_that_of_the_recorder(read: Read) -> None:
    layout = LAYOUTS["can_msgs"]
    unstamped = Layout(layout.name, layout.encoding, layout.definition, "cdr", lambda _: layout.write(Frame(0, 1, b"")))
    builder = Builder()
    for t in (10, 20):
        builder.add("/can0/rx", unstamped, Frame(t, 1, b""))
    builder.add("/can0/rx", layout, Frame(30, 1, b""))
    got = read(builder.bytes())
    assert [frame.t for frame in got.frames] == [10, 20, 30]
    assert got.notes == ["time is header.stamp, log_time for 2 messages"]


def test_what_carries_no_can_is_other(read: Read) -> None:
    builder = Builder()
    imu = Layout("sensor_msgs/msg/Imu", "ros2msg", b"float64 x", "cdr", lambda _: bytes(12))
    own = Layout("my/msg/CanFrame", "ros2msg", b"uint32 can_id\nuint8[] payload", "cdr", lambda _: bytes(12))
    swapped = mcaps.FIELDS["Frame"].replace("bool is_rtr\nbool is_extended", "bool is_extended\nbool is_rtr")
    other = Layout("can_msgs/msg/Frame", "ros2msg", (swapped + mcaps.STAMP2).encode(), "cdr", lambda _: bytes(40))
    bare = Layout("", "", b"", "json", lambda _: json.dumps({"speed": 1}).encode())
    for topic, layout in (("/imu", imu), ("/a", own), ("/b", other), ("/c", bare)):
        builder.add(topic, layout, ROWS[0])
    got = read(builder.bytes())
    assert (got.frames, got.lines["other"], got.lines["unreadable"]) == ([], 4, 0)
    assert got.notes == [
        "/a (my/msg/CanFrame) looks like CAN, its layout is not known",
        "/b (can_msgs/msg/Frame) looks like CAN, its layout is not known",
    ]
    builder = Builder()
    builder.add("/imu", imu, ROWS[0])
    assert read(builder.bytes()).notes == ["no channel with CAN frames among 1"]


def test_a_known_layout_under_another_name(read: Read) -> None:
    header = "Header header\n" + mcaps.FIELDS["Frame"].partition("\n")[2].replace("uint8 dlc", "byte dlc  # length")
    definition = f"uint8 CLASSIC=1\n{header}\n".encode()
    layout = Layout("acme/msg/Bus", "ros2msg", definition, "cdr", LAYOUTS["can_msgs"].write)
    builder = Builder()
    for row in ROWS:
        builder.add("/x", layout, row)
    assert read(builder.bytes()).frames == ROWS


@pytest.mark.slow
def test_a_known_name_without_a_definition(read: Read) -> None:
    builder = Builder()
    layout = LAYOUTS["can_msgs"]
    for row in ROWS:
        builder.add("/x", Layout(layout.name, "", b"", "cdr", layout.write), row)
    assert read(builder.bytes()).frames == ROWS
