"""Schemas of all kinds: which describe CAN, which only look like it, and what damaged and hostile ones come to."""

from __future__ import annotations

import json
import random
from typing import TYPE_CHECKING, Any

import pytest
from kit.mcaps import (
    EXTENDED,
    FD,
    REMOTE,
    Builder,
    Frame,
    Got,
    Layout,
    build,
    descriptors,
    frames,
    from_pieces,
    pb,
    proto,
)

from analyzer.sources.mcap import descriptor, idl, jsons, protobuf, ros, topics

if TYPE_CHECKING:
    from collections.abc import Callable

ROW = Frame(1_700_000_000_123_456_789, 0x123, bytes.fromhex("A6350000"), "lane", 0)
NUMBERS = list(ROW.data)
VAGUE = "has an identifier and data, but nothing says that they are CAN"
FLAGS = "without a flag for extended frames: ids above 0x7FF are taken as extended"


def read(layout: Layout, topic: str = "/lane", count: int = 1) -> Got:
    builder = Builder()
    for _ in range(count):
        builder.add(topic, layout, ROW)
    return from_pieces([builder.bytes()])


def in_json(value: Any, schema: Any = None, name: str = "Event") -> Layout:
    """Messages that are all `value`, or bytes as they are."""
    message = value if isinstance(value, bytes) else json.dumps(value).encode()
    text = b"" if schema is None else json.dumps(schema).encode()
    name, encoding = ("", "") if schema is None else (name, "jsonschema")
    return Layout(name, encoding, text, "json", lambda _: message)


def described(**kinds: str) -> dict[str, Any]:
    return {"type": "object", "properties": {name: {"type": kind} for name, kind in kinds.items()}}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["protobuf", "json", "bare json", "can_msgs", "idl", "ros1"])
def test_no_flipped_byte_ends_in_an_exception(name: str) -> None:
    data = build(frames(3), name, chunked=False)
    some = random.Random(name)
    for at in range(len(data)):
        for bits in (1 << some.randrange(8), some.randrange(1, 256)):
            from_pieces([data[:at] + bytes([data[at] ^ bits]) + data[at + 1 :]])


@pytest.mark.parametrize("number", [0, 1 << 29, 1 << 40])
def test_field_numbers_that_there_cannot_be(number: int) -> None:
    layout = proto(lambda _: b"", CanFrame={"can_id": (1, "uint32"), "data": (number, "bytes")})
    got = read(layout)
    assert (got.frames, got.lines["other"]) == ([], 1)
    assert got.notes == ["/lane (p.CanFrame) looks like CAN, its layout is not known"]


def test_field_numbers_that_stand_there_twice() -> None:
    fields = {"can_id": (1, "uint32"), "data": (2, "bytes"), "extended": (2, "bool"), "bus": (1, "string")}
    layout = proto(lambda f: pb((1, f.id), (2, f.data)), CanFrame=fields)
    assert read(layout).frames == [ROW]


def test_a_layout_that_cannot_be_used() -> None:
    """Half a letter is no name of a field."""
    got = read(in_json(b'{"can_id":1,"data":[1],"\\ud800":{"x":1},"bus\\u002d":"a"}'))
    assert [frame.bus for frame in got.frames] == ["a"]
    got = read(in_json(b'{"\\ud800":{"can_id":1,"data":[1]}}'))
    assert (got.frames, got.lines["other"]) == ([], 1)
    assert got.notes == ["/lane cannot be read: its layout cannot be used"]


CHUNK = proto(lambda f: pb((1, f.id), (2, f.data)), ImageChunk={"id": (1, "uint32"), "data": (2, "bytes")})
NO_CAN = {
    "image": (CHUNK, "p.ImageChunk"),
    "mavlink": (in_json({"msgid": 5, "len": 2, "payload": [1, 2], "seq": 3}), ""),
    "log": (in_json({"id": 3, "name": "log", "data": "abcd"}), ""),
    "event": (in_json({"id": 3, "data": "hello"}, described(id="integer", data="string")), "Event"),
    "modbus": (in_json({"id": 3, "data": [1]}, described(id="integer", data="array"), "ModbusFrame"), "ModbusFrame"),
    "stamped": (in_json({"header": {"frame_id": "camera"}, "id": 3, "data": [1]}), ""),
    "long": (in_json({"identifier": 3, "bytes": [1], "length": 1, "error": False, "channel": "x"}), ""),
}


@pytest.mark.parametrize("name", NO_CAN)
def test_an_identifier_and_data_alone_are_not_can(name: str) -> None:
    layout, kind = NO_CAN[name]
    got = read(layout, "/scan/modbus", count=70)
    assert (got.frames, got.lines["other"], got.lines["unreadable"]) == ([], 70, 0)
    assert got.notes == [f"/scan/modbus{f' ({kind})' if kind else ''} {VAGUE}"]


@pytest.mark.parametrize("topic", ["/can/raw", "/can0", "/vcan0/x", "/from_can_bus", "/RawCANFrames", "/socketcan"])
def test_a_topic_may_say_that_they_are_can(topic: str) -> None:
    assert len(read(in_json({"id": 1, "data": [1]}), topic).frames) == 1
    assert len(read(CHUNK, topic).frames) == 1


def test_what_else_says_that_they_are_can() -> None:
    both = {"id": (1, "uint32"), "data": (2, "bytes")}
    write = CHUNK.write
    inner = {"f": (3, "p.CANFDFrame")}
    for layout in (
        proto(write, CanFrame=both),
        proto(write, X=both | {"is_extended": (3, "bool")}),
        proto(write, X=both | {"iface": (3, "string")}),
        proto(write, X=both | {"rtr": (4, "bool")}),
        proto(lambda f: pb((3, write(f))), Envelope=inner, CANFDFrame=both),
        proto(lambda f: pb((3, write(f))), Envelope={"can": (3, "p.X")}, X=both),
        proto(lambda f: pb((3, write(f)), (1, 7), (2, b"x")), Message=both | {"can": (3, "p.X")}, X=both),
        in_json({"id": ROW.id, "data": NUMBERS, "interface": "lane"}),
        in_json({"canId": ROW.id, "payload": NUMBERS}),
        in_json({"id": ROW.id, "canData": NUMBERS}),
        in_json({"id": ROW.id, "data": NUMBERS}, described(id="integer", data="array"), "can_message"),
        in_json({"raw": {"can_frame": {"id": ROW.id, "data": NUMBERS}}}),
    ):
        assert read(layout).frames == [ROW], layout
    for word in ("scan", "/trucks/candle", "canal", "Cancel", "ScanFrame", "modbus", "american", ""):
        assert not topics.says_can(word), word


LISTED = [
    ("id", "data", "extended", "iface"),
    ("can_id", "payload", "extended_id", "can_bus"),
    ("message_id", "can_data", "is_extended", "interface"),
    ("id", "byte_values", "ext_frame", "bus"),
    ("frame_id", "payload", "is_extended_frame", "channel"),
    ("arbitrationId", "data", "isExt", "busId"),
    ("canId", "frameData", "EFF", "if_name"),
]


@pytest.mark.parametrize("names", LISTED)
def test_names_of_fields(names: tuple[str, ...]) -> None:
    number, data, extended, bus = names
    fields = {number: (4, "uint32"), data: (3, "bytes"), extended: (2, "bool"), bus: (1, "string")}
    got = read(proto(lambda f: pb((4, f.id), (3, f.data), (2, 1), (1, "can9")), CanFrame=fields))
    assert got.frames == [Frame(ROW.t, ROW.id, ROW.data, "can9", EXTENDED)]
    assert got.notes == ["time is log_time"]


@pytest.mark.parametrize("dlc", ["dlc", "can_dlc", "data_length", "len", "dataLen"])
@pytest.mark.parametrize("flag", ["is_remote", "remote_frame", "isRTR", "rtr"])
def test_names_of_lengths_and_flags(dlc: str, flag: str) -> None:
    fields = {"id": (1, "uint32"), "data": (2, "bytes"), dlc: (3, "uint32"), flag: (4, "bool")}
    for value, row in ((0, Frame(ROW.t, 5, b"ab", "lane", 0)), (1, Frame(ROW.t, 5, b"", "lane", REMOTE | 2 << 8))):
        message = pb((1, 5), (2, b"abcd"), (3, 2), (4, value))
        assert read(proto(lambda _, message=message: message, CanFrame=fields)).frames == [row]
    for name in ("is_fd", "canfd", "fd", "isCanFd"):
        fields = {"id": (1, "uint32"), "data": (2, "bytes"), name: (4, "bool")}
        got = read(proto(lambda _: pb((1, 5), (4, 1)), CanFrame=fields))
        assert [frame.flags for frame in got.frames] == [FD]
        assert got.notes[0] == f"protobuf {FLAGS}"


def test_json_may_begin_with_something_else() -> None:
    builder = Builder()
    for value in [{"hello": 1}] * 3 + [{"can_id": 5, "data": [1]}] * 2 + [{"hello": 1}]:
        builder.add("/lane", in_json(value), ROW)
    got = from_pieces([builder.bytes()])
    assert ([frame.id for frame in got.frames], got.lines["other"], got.lines["unreadable"]) == ([5, 5], 3, 1)
    assert got.notes[0] == "/lane: messages before the first frame left out: 3"
    builder = Builder()
    for value in [{"hello": 1}] * 65 + [{"can_id": 5, "data": [1]}]:
        builder.add("/lane", in_json(value), ROW)
    got = from_pieces([builder.bytes()])
    assert (got.frames, got.lines["other"]) == ([], 66)
    assert got.notes == ["no channel with CAN frames among 1"]


def test_lists_of_frames_are_not_read() -> None:
    one = {"can_id": 1, "data": [1]}
    schema = {"properties": {"frames": {"type": "array", "items": described(can_id="integer", data="array")}}}
    for layout in (in_json([one]), in_json({"frames": [one]}), in_json({"a": {"b": [one, one]}})):
        got = read(layout, count=2)
        assert (got.frames, got.lines["other"]) == ([], 2)
        assert got.notes == ["/lane holds lists of frames, which are not read"]
    assert read(in_json({}, schema)).notes == ["/lane (Event) holds lists of frames, which are not read"]
    assert read(in_json({"images": [{"id": 1, "data": [1]}]})).notes == ["no channel with CAN frames among 1"]


def test_only_a_file_without_a_channel_says_so() -> None:
    got = read(in_json({"hello": 1}), count=2)
    assert got.notes == ["no channel with CAN frames among 1"]
    got = read(Layout("can_msgs/msg/Frame", "", b"", "cdr", lambda _: b""))
    assert (got.lines["unreadable"], got.notes) == (1, [])


def test_a_message_that_is_no_json_says_so() -> None:
    for layout in (in_json(b"{"), in_json(b"{", described(x="integer"))):
        assert read(layout, count=2).texts == ["message of channel 1: not JSON"] * 2


UNITS = [
    *("/*", '"', '\\"', '"\\', "module a { ", "struct a { octet b; ", "}", "sequence<", "@a(", "/", "/* *", "'"),
    *("typedef a[1] a;", "typedef sequence<a> a;", "===\n", "=== \t", "===\nMSG: a/b\na b\n", "a b\n", " ", "\n", "a "),
]


@pytest.mark.sampled(10)
@pytest.mark.parametrize("unit", UNITS)
def test_hostile_definitions_end(unit: str) -> None:
    """What is quadratic takes minutes for as much."""
    text = (unit * (1 << 20))[: 1 << 20]
    assert len(idl.structs(text)) <= 17
    for part in (text, text[: 1 << 16]):
        for encoding in ("ros2msg", "ros2idl"):
            assert ros.layout_of("a/msg/B", encoding, part.encode(), "ros2") is None


def test_definitions_that_branch() -> None:
    """Nothing is in them, and there is very much of it."""
    text = "".join(f"===\nMSG: a/T{k}\n" + f"a/T{k + 1} x\n" * 100 for k in range(7)) + "===\nMSG: a/T7\n"
    assert ros.layout_of("a/T0", "ros2msg", text.encode(), "ros2") is None
    types: dict[str, dict[str, tuple[int, str]]] = {
        f"T{k}": {f"f{n}": (n + 1, f"p.T{k + 1}") for n in range(40)} for k in range(8)
    }
    assert protobuf.layout_of("p.T0", descriptors("p", **types), named=True) == (None, "")
    inner = {"type": "object", "properties": {str(k): {"$ref": "#/definitions/a"} for k in range(1000)}}
    schema = {"$ref": "#/definitions/a", "definitions": {"a": inner}}
    assert jsons.layout_of(schema, None, named=True) == (None, "")


def test_deep_idl() -> None:
    def nested(depth: int) -> str:
        return "module a { " * depth + "struct S { octet x; }; " + "}; " * depth

    assert list(idl.structs(nested(15))) == ["::".join(["a"] * 15 + ["S"])]
    assert idl.structs(nested(16)) == {"::".join(["a"] * 16 + ["S"]): []}
    assert idl.structs(nested(17)) == {}
    assert idl.structs(f"struct S {{ {'sequence<' * 5000}octet{'>' * 5000} x; octet y; }};")["S"][1] == ("uint8", "y")


@pytest.mark.parametrize("body", [b"\x22\x00", b"\x10\x00", pb((4, b"\x12\x00" * 1000))])
def test_descriptors_with_very_many_fields(body: bytes) -> None:
    with pytest.raises(ValueError, match="too many fields"):
        descriptor.messages(pb((1, body * (1 + (1 << 19) // len(body)))))


@pytest.mark.parametrize("text", [b"[" * 200_000, b'{"a":' * 50_000, b"1" * 200_000, b"", b"\xff", b" " * (1 << 20)])
def test_json_that_cannot_be_parsed(text: bytes) -> None:
    with pytest.raises(ValueError, match=r"."):
        jsons.parsed(text)


def writes(text: str) -> Callable[[Frame], bytes]:
    return lambda f: pb((1, f.id), (2, text))


def test_strings_of_protobuf_hold_data() -> None:
    for fields, text in (
        ({"can_id": (1, "uint32"), "data": (2, "string")}, "A6 35 00 00"),
        ({"can_id": (1, "uint32"), "data": (2, "string")}, "pjUAAA=="),
        ({"can_id": (1, "uint32"), "data_base64": (2, "string")}, "pjUAAA=="),
        ({"can_id": (1, "uint32"), "dataHex": (2, "string")}, "A6350000"),
    ):
        assert read(proto(writes(text), CanFrame=fields)).frames == [ROW]
