"""Which messages are CAN frames, and which of their fields is what: JSON and Protocol Buffers as they are found."""

from __future__ import annotations

import base64
import json
from typing import Any

import pytest
from kit.mcaps import EXTENDED, FD, Builder, Frame, Got, Layout, descriptors, from_pieces, pb, proto

from analyzer.sources.mcap import descriptor, idl, protobuf, ros

ROW = Frame(1_700_000_000_123_456_789, 0x123, bytes.fromhex("A6350000"), "can7", 0)
BRS, TX = 16, 64


def read(layout: Layout, row: Frame = ROW, topic: str = "/can7/rx") -> Got:
    builder = Builder()
    builder.add(topic, layout, row)
    return from_pieces([builder.bytes()])


def in_json(value: Any, schema: Any = None) -> Layout:
    text = b"" if schema is None else json.dumps(schema).encode()
    name, encoding = ("", "") if schema is None else ("msg", "jsonschema")
    return Layout(name, encoding, text, "json", lambda _: json.dumps(value).encode())


NUMBERS = [0xA6, 0x35, 0, 0]
JSONS: dict[str, tuple[dict[str, Any], int, str]] = {
    "numbers": ({"id": 0x123, "data": NUMBERS, "interface": "can7"}, 0, "log_time"),
    "hex": ({"can_id": "0x123", "payload": "A6 35 00 00"}, 0, "log_time"),
    "base64": ({"id": 0x123, "data": base64.b64encode(b"\xa6\x35\0\0").decode()}, 0, "log_time"),
    "flags": (
        {"id": 0x123, "data": NUMBERS, "extended": True, "fd": True, "brs": True},
        EXTENDED | FD | BRS,
        "log_time",
    ),
    "nested": ({"frame": {"id": 0x123, "data": NUMBERS}, "bus": "can7"}, 0, "log_time"),
    "sent": ({"arbitrationId": 0x123, "data": NUMBERS, "direction": "tx"}, TX, "log_time"),
    "time": ({"id": 0x123, "data": NUMBERS, "timestamp_ns": ROW.t}, 0, "the message's own"),
    "two": (
        {"id": 0x123, "data": NUMBERS, "stamp": dict(zip(("sec", "nsec"), ROW.stamp, strict=True))},
        0,
        "the message's own",
    ),
    "header": ({"header": {"frame_id": "can7"}, "id": 0x123, "dlc": 4, "data": [*NUMBERS, 9, 9, 9, 9]}, 0, "log_time"),
}


@pytest.mark.parametrize("name", JSONS)
def test_json_without_a_schema(name: str) -> None:
    value, flags, timed = JSONS[name]
    got = read(in_json(value))
    assert got.frames == [Frame(ROW.t, ROW.id, ROW.data, "can7", flags)]
    assert got.notes[-1] == f"time is {timed}"
    assert any("above 0x7FF" in note for note in got.notes) == (name != "flags")


def test_json_with_a_schema() -> None:
    """Fields that the first message lacks; texts whose coding only the schema tells; references."""
    frame = {
        "type": "object",
        "properties": {
            "id": {"type": "integer"},
            "data": {"type": "string", "contentEncoding": "base64"},
            "extended": {"type": "boolean"},
        },
    }
    schema = {"$ref": "#/definitions/f", "definitions": {"f": frame}}
    text = base64.b64encode(bytes.fromhex("69B71D79")).decode()
    builder = Builder()
    for more in ({}, {"extended": True}):
        builder.add("/x", in_json({"id": 5, "data": text} | more, schema), ROW)
    got = from_pieces([builder.bytes()])
    assert [frame.flags for frame in got.frames] == [0, EXTENDED]
    assert {frame.data for frame in got.frames} == {bytes.fromhex("69B71D79")}


def test_json_that_is_none_does_not_decide() -> None:
    builder = Builder()
    good, bad = in_json({"id": 5, "data": [1]}), Layout("", "", b"", "json", lambda _: b"{")
    for layout in (bad, good):
        builder.add("/can5", layout, ROW)
    got = from_pieces([builder.bytes()])
    assert [(frame.id, frame.bus) for frame in got.frames] == [(5, "can5")]
    assert got.texts == ["message of channel 1: not JSON"]


@pytest.mark.parametrize(
    "value", [{"id": 5}, {"data": [1]}, {"id": [5], "data": [1]}, {"id": 5, "data": {}}, [1], "x", 5]
)
def test_json_that_is_no_frame(value: Any) -> None:
    got = read(in_json(value))
    assert (got.frames, got.lines["other"], got.lines["unreadable"]) == ([], 1, 0)


PROTOS = {
    "id and data": (
        proto(lambda f: pb((5, f.id), (1, f.data)), CanFrame={"data": (1, "bytes"), "id": (5, "uint32")}),
        "p.CanFrame",
    ),
    "inside another": (
        proto(
            lambda f: pb((2, pb((1, f.id), (2, f.data))), (7, "can7")),
            Envelope={"raw": (2, "p.Raw"), "can_bus": (7, "string")},
            Raw={"message_id": (1, "uint32"), "can_data": (2, "bytes")},
        ),
        "p.Envelope",
    ),
    "repeated numbers": (
        proto(
            lambda f: pb((1, f.id), *((2, byte) for byte in f.data)),
            CanFrame={"can_id": (1, "uint32"), "byte_values": (2, "repeated uint32")},
        ),
        "p.CanFrame",
    ),
}


@pytest.mark.parametrize("name", PROTOS)
def test_protobuf_by_names(name: str) -> None:
    got = read(PROTOS[name][0])
    assert got.frames == [ROW]
    assert got.notes == [
        "protobuf without a flag for extended frames: ids above 0x7FF are taken as extended",
        "time is log_time",
    ]


def test_protobuf_that_is_no_frame() -> None:
    lists = proto(
        lambda _: b"", CanFrames={"frames": (1, "repeated p.F")}, F={"id": (1, "uint32"), "data": (2, "bytes")}
    )
    got = read(lists)
    assert (got.frames, got.lines["other"]) == ([], 1)
    assert got.notes[0] == "/can7/rx (p.CanFrames) holds lists of frames, which are not read"
    for fields in (
        {"id": (1, "uint32")},
        {"id": (1, "uint32"), "data": (2, "bool")},
    ):
        assert read(proto(lambda _: b"", X=fields)).lines["other"] == 1


@pytest.mark.slow
def test_descriptors_that_never_end() -> None:
    """Messages that hold themselves, and damaged ones."""
    data = descriptors("p", A={"a": (1, "p.A"), "b": (2, "p.A"), "c": (3, "p.A"), "d": (4, "p.A")})
    assert protobuf.layout_of("p.A", data, named=True) == (None, "")
    for at in range(len(data)):
        for bad in (data[:at], data[:at] + bytes([data[at] ^ 0x55]) + data[at + 1 :]):
            protobuf.layout_of("p.A", bad, named=True)
    deep = b""
    for _ in range(200):
        deep = pb((1, "M"), (3, deep))
    with pytest.raises(ValueError, match="too deep"):
        descriptor.messages(pb((1, pb((4, deep)))))


def test_definitions_that_never_end() -> None:
    text = b"a/A one\na/A two\na/A three\n===\nMSG: a/A\na/A again\na/A once\n"
    for name in ("a/A", "a/B"):
        assert ros.layout_of(name, "ros2msg", text, "ros2") is None
    assert ros.layout_of("x", "ros2msg", b"uint8 x\n" * 100_000, "ros2") is None


def test_idl() -> None:
    text = """
    module a { module b {
      const long N = 5; // { not this
      /* nor } this */
      typedef sequence<octet, 64> some; typedef unsigned short word[3];
      @final struct S { some data; @key(value = (1)) word w; sequence<a::c::T> list; string<20> name; };
      enum E { A, B };
      struct Broken { ; x; };
    }; };
    }}} struct
    """
    assert idl.structs(text) == {
        "a::b::S": [("uint8[<=64]", "data"), ("uint16[3]", "w"), ("a::c::T[]", "list"), ("string < 20 >", "name")],
        "a::b::Broken": [],
    }
    for at in range(len(text)):
        idl.structs(text[:at] + text[at + 1 :])
