"""MCAP files for tests, written with the `mcap` package: every layout of a CAN frame; and what is read of them."""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass, field
from io import BytesIO
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from mcap.writer import CompressionType, Writer

from analyzer.sources import Source
from analyzer.sources.mcap import read

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence
    from pathlib import Path

    from analyzer._native import FrameBatch

EXTENDED, REMOTE, ERROR, FD = 1, 2, 4, 8
RULE = "=" * 80
STAMP2 = (
    f"\n{RULE}\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
    f"{RULE}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
)
STAMP1 = f"\n{RULE}\nMSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n"
FIELDS = {
    "Frame": (
        "std_msgs/Header header\nuint32 id\nbool is_rtr\nbool is_extended\nbool is_error\nuint8 dlc\nuint8[8] data"
    ),
    "FdFrame": "std_msgs/Header header\nuint32 id\nbool is_extended\nbool is_error\nuint8 len\nuint8[<=64] data",
    "Any": (
        "std_msgs/Header header\nuint32 id\nbool is_rtr\nbool is_extended\nbool is_error\nbool is_fd_frame\nuint8 dlc\n"
        "uint8[64] data"
    ),
}
IDL = f"""
// generated
module can_msgs {{ module msg {{
    typedef uint8 uint8__8[8];
    @verbatim (language="comment", text="A frame; as {{it}} was" "seen.")
    struct Frame {{
        std_msgs::msg::Header header;
        uint32 id; boolean is_rtr; boolean is_extended;
        boolean is_error;
        @unit (value="bytes") uint8 dlc;
        uint8__8 data;
    }};
}}; }};
{RULE}
IDL: std_msgs/msg/Header
#include "builtin_interfaces/msg/Time.idl"
module std_msgs {{ module msg {{ struct Header {{ builtin_interfaces::msg::Time stamp; string frame_id; }}; }}; }};
{RULE}
IDL: builtin_interfaces/msg/Time
module builtin_interfaces {{ module msg {{ struct Time {{ int32 sec; uint32 nanosec; }}; }}; }};
"""
JSON_SCHEMA = {
    "type": "object",
    "properties": {
        "id": {"type": "integer"},
        "data": {"type": "array", "items": {"type": "integer"}},
        "interface": {"type": "string"},
    },
}


@dataclass(frozen=True)
class Frame:
    """A row as a reader has to give it; `bus` is empty for messages that name none."""

    t: int
    id: int
    data: bytes
    bus: str = "can0"
    flags: int = EXTENDED

    @property
    def stamp(self) -> tuple[int, int]:
        return divmod(self.t, 10**9)


def frames(count: int, start: int = 1_700_000_000_000_000_000, buses: Sequence[str] = ("can0",)) -> list[Frame]:
    """Extended frames of every length, times that grow by odd steps."""
    return [
        Frame(
            start + k * 1_234_567,
            0x0504_0601 + (k % 5 << 16),
            bytes((k + i) % 256 for i in range(k % 9)),
            buses[k % len(buses)],
        )
        for k in range(count)
    ]


def header2(frame: Frame) -> bytes:
    name = frame.bus.encode() + b"\0"
    return b"\0\1\0\0" + struct.pack("<iII", *frame.stamp, len(name)) + name + bytes(-len(name) % 4)


def header1(frame: Frame) -> bytes:
    return struct.pack("<IIII", 7, *frame.stamp, len(frame.bus)) + frame.bus.encode()


def flag(frame: Frame, bit: int) -> bool:
    return bool(frame.flags & bit)


def classic(header: Callable[[Frame], bytes]) -> Callable[[Frame], bytes]:
    def write(frame: Frame) -> bytes:
        flags = flag(frame, REMOTE), flag(frame, EXTENDED), flag(frame, ERROR)
        return header(frame) + struct.pack("<I???B8s", frame.id, *flags, len(frame.data), frame.data)

    return write


def fd_frame(frame: Frame) -> bytes:
    size, flags = len(frame.data), (flag(frame, EXTENDED), flag(frame, ERROR))
    return header2(frame) + struct.pack("<I??BxI", frame.id, *flags, size, size) + frame.data


def any_frame(frame: Frame) -> bytes:
    flags = flag(frame, REMOTE), flag(frame, EXTENDED), flag(frame, ERROR), flag(frame, FD)
    return header2(frame) + struct.pack("<I????B64s", frame.id, *flags, len(frame.data), frame.data)


def in_json(frame: Frame) -> bytes:
    return json.dumps({"id": frame.id, "data": list(frame.data), "interface": frame.bus}).encode()


def varint(value: int) -> bytes:
    out = b""
    while value > 127:
        out += bytes([value & 127 | 128])
        value >>= 7
    return out + bytes([value])


def pb(*fields: tuple[int, int | bytes | str]) -> bytes:
    """A Protocol Buffers message: numbers as varints, everything else with its length."""
    out = b""
    for number, value in fields:
        if isinstance(value, int):
            out += varint(number << 3) + varint(value)
        else:
            raw = value.encode() if isinstance(value, str) else value
            out += varint(number << 3 | 2) + varint(len(raw)) + raw
    return out


TYPES = {"uint32": 13, "uint64": 4, "int32": 5, "int64": 3, "bool": 8, "string": 9, "bytes": 12}


def descriptors(package: str, **types: dict[str, tuple[int, str]]) -> bytes:
    """A FileDescriptorSet: of each message its fields as number and type; `repeated` may stand in front of the type."""

    def one(name: str, number: int, kind: str) -> bytes:
        plain = kind.removeprefix("repeated ")
        inner: list[tuple[int, int | bytes | str]] = (
            [(5, TYPES[plain])] if plain in TYPES else [(5, 11), (6, f".{plain}")]
        )
        return pb((1, name), (3, number), (4, 1 if kind == plain else 3), *inner)

    messages = [
        pb((1, message), *((2, one(name, *what)) for name, what in fields.items())) for message, fields in types.items()
    ]
    return pb((1, pb((1, "x.proto"), (2, package), *((4, message) for message in messages), (12, "proto3"))))


PROTO = descriptors(
    "my.bus",
    CanFrame={
        "timestamp": (9, "my.bus.Stamp"),
        "can_id": (4, "uint32"),
        "extended_id": (2, "bool"),
        "payload": (7, "bytes"),
        "iface": (30, "string"),
    },
    Stamp={"seconds": (1, "int64"), "nanos": (2, "int32")},
)


def in_protobuf(frame: Frame) -> bytes:
    stamp = pb((1, frame.stamp[0]), (2, frame.stamp[1]))
    return pb((4, frame.id), (2, int(flag(frame, EXTENDED))), (7, frame.data), (30, frame.bus), (9, stamp))


@dataclass(frozen=True)
class Layout:
    """How a channel's messages are described and written."""

    name: str
    encoding: str
    definition: bytes
    message_encoding: str
    write: Callable[[Frame], bytes]


def proto(write: Callable[[Frame], bytes], **types: dict[str, tuple[int, str]]) -> Layout:
    """Messages of the first of these types, all in the package `p`."""
    return Layout(f"p.{next(iter(types))}", "protobuf", descriptors("p", **types), "protobuf", write)


LAYOUTS = {
    "can_msgs": Layout("can_msgs/msg/Frame", "ros2msg", (FIELDS["Frame"] + STAMP2).encode(), "cdr", classic(header2)),
    "idl": Layout("can_msgs/msg/Frame", "ros2idl", IDL.encode(), "cdr", classic(header2)),
    "ros1": Layout("can_msgs/Frame", "ros1msg", (FIELDS["Frame"] + STAMP1).encode(), "ros1", classic(header1)),
    "fd": Layout("ros2_socketcan_msgs/msg/FdFrame", "ros2msg", (FIELDS["FdFrame"] + STAMP2).encode(), "cdr", fd_frame),
    "socketcan": Layout(
        "ros2_socketcan_msgs/msg/Frame", "ros2msg", (FIELDS["Any"] + STAMP2).encode(), "cdr", any_frame
    ),
    "json": Layout("can_msg", "jsonschema", json.dumps(JSON_SCHEMA).encode(), "json", in_json),
    "bare json": Layout("", "", b"", "json", in_json),
    "protobuf": Layout("my.bus.CanFrame", "protobuf", PROTO, "protobuf", in_protobuf),
}
COMPRESSIONS = {"none": CompressionType.NONE, "zstd": CompressionType.ZSTD, "lz4": CompressionType.LZ4}


@dataclass
class Builder:
    """A file under way. Messages go to the channel of their topic and layout, made when it is needed."""

    compression: str = "none"
    chunked: bool = True
    chunk_size: int = 1 << 20
    options: dict[str, Any] = field(default_factory=dict)
    metadata: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.out = BytesIO()
        kind = COMPRESSIONS[self.compression]
        self.writer = Writer(self.out, self.chunk_size, kind, use_chunking=self.chunked, **self.options)
        self.writer.start("", "tests")
        self._schemas: dict[str, int] = {"": 0}
        self._channels: dict[tuple[str, str], int] = {}

    def channel(self, topic: str, layout: Layout) -> int:
        if layout.name not in self._schemas:
            self._schemas[layout.name] = self.writer.register_schema(layout.name, layout.encoding, layout.definition)
        key = topic, layout.name
        if key not in self._channels:
            schema = self._schemas[layout.name]
            self._channels[key] = self.writer.register_channel(topic, layout.message_encoding, schema, self.metadata)
        return self._channels[key]

    def add(self, topic: str, layout: Layout, frame: Frame) -> None:
        self.writer.add_message(self.channel(topic, layout), frame.t, layout.write(frame), frame.t)

    def bytes(self) -> bytes:
        self.writer.finish()
        return self.out.getvalue()


def build(rows: Iterable[Frame], layout: str = "can_msgs", topic: str = "/can0/rx", **more: Any) -> bytes:
    """A whole file of one channel."""
    builder = Builder(**more)
    for frame in rows:
        builder.add(topic, LAYOUTS[layout], frame)
    return builder.bytes()


def rows_of(piece: FrameBatch) -> Iterator[Frame]:
    columns, _ = piece.columns()
    names = piece.buses
    ends = memoryview(columns["data_offset"]).cast("i")
    words = {name: memoryview(columns[name]).cast(code) for name, code in (("t", "q"), ("id", "I"), ("flags", "H"))}
    data = columns["data"]
    for row, bus in enumerate(columns["bus"]):
        t, number, flags = (words[name][row] for name in ("t", "id", "flags"))
        yield Frame(t, number, data[ends[row] : ends[row + 1]], names[bus], flags)


def texts_of(piece: FrameBatch) -> list[str]:
    """What the events say."""
    _, columns = piece.columns()
    ends = memoryview(columns["text_offset"]).cast("i")
    return [columns["text"][start:end].decode() for start, end in pairwise(ends)]


class Got:
    """Everything that a source gave; each record is accounted for."""

    def __init__(self, source: Source, chunks: Iterable[bytes | FrameBatch]) -> None:
        pieces = [piece for piece in chunks if not isinstance(piece, bytes)]
        self.notes = source.notes
        self.frames = [frame for piece in pieces for frame in rows_of(piece)]
        self.texts = [text for piece in pieces for text in texts_of(piece)]
        self.lines = {key: sum(piece.lines[key] for piece in pieces) for key in pieces[0].lines}
        assert self.lines.pop("lines") == sum(self.lines.values()) - self.lines["dropped_frames"]
        self.damage = str(source.damage).removeprefix(f"{source.name}: ") if source.damage else ""

    @property
    def told(self) -> bool:
        """Whether anything was said to be damaged."""
        return bool(self.damage or self.lines["unreadable"])

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Got) and vars(self) == vars(other)

    __hash__ = None  # type: ignore[assignment]


def from_file(path: Path, data: bytes) -> Got:
    path.write_bytes(data)
    source = Source(str(path))
    return Got(source, source.chunks())


def from_pieces(pieces: Iterable[bytes]) -> Got:
    """As from a pipe."""
    source = Source("-")
    return Got(source, read(source, iter(pieces)))


def cut(data: bytes, size: int) -> list[bytes]:
    return [data[at : at + size] for at in range(0, len(data), size)]
