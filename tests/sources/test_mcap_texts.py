"""Bytes and identifiers in text: what decides how they are coded, for all messages of a channel, and what is said."""

from __future__ import annotations

import base64
import json
from typing import TYPE_CHECKING, Any

import pytest
from kit.mcaps import LAYOUTS, Builder, Frame, Got, Layout, cut, from_pieces

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

AS_HEX = "data in text taken as hex, though it may be base64"
AS_DECIMAL = "identifiers in text taken as decimal, though they may be hex"
CODINGS: dict[str, Callable[[bytes], str]] = {
    "hex": bytes.hex,
    "HEX": lambda data: data.hex(" ").upper(),
    "base64": lambda data: base64.b64encode(data).decode(),
    "url": lambda data: base64.urlsafe_b64encode(data).decode().rstrip("="),
}


def built(values: Iterable[dict[str, Any]], schema: Any = None, **options: Any) -> bytes:
    text = b"" if schema is None else json.dumps(schema).encode()
    name, encoding = ("", "") if schema is None else ("msg", "jsonschema")
    builder = Builder(**options)
    for k, value in enumerate(values):
        message = json.dumps(value).encode()
        builder.add("/can0", Layout(name, encoding, text, "json", lambda _, m=message: m), Frame(k + 1, 0, b""))
        builder.add("/can1/rx", LAYOUTS["can_msgs"], Frame(k + 1, k, b"", "can1", 0))
    return builder.bytes()


def read(values: Iterable[dict[str, Any]], schema: Any = None) -> tuple[list[Frame], Got]:
    """The frames of the messages, and everything; messages of another channel stand between."""
    values = list(values)
    got = from_pieces([built(values, schema)])
    assert [frame.t for frame in got.frames if frame.bus == "can1"] == [k + 1 for k in range(len(values))]
    order = [(frame.t, frame.bus) for frame in got.frames]
    assert order == sorted(order)
    return [frame for frame in got.frames if frame.bus == "can0"], got


def texts(data: list[bytes], coding: str, **more: Any) -> list[dict[str, Any]]:
    return [{"id": 5, "data": CODINGS[coding](one)} | more for one in data]


FIRST = {
    "empty": b"",
    "zeros": bytes(6),
    "three": bytes(3),
    "low": b"\0\x10\x83\0\x10\x83",
    "AA": b"\xaa" * 4,
    "digits": b"\x12\x34\x56\x78",
}


@pytest.mark.parametrize("coding", CODINGS)
@pytest.mark.parametrize("first", FIRST)
def test_a_first_message_that_fits_both_does_not_decide(coding: str, first: str) -> None:
    data = [FIRST[first]] * 3 + [bytes([k, 255 - k, 7, k, k]) for k in range(1, 20)]
    found, got = read(texts(data, coding))
    assert [frame.data for frame in found] == data
    assert not any("taken as hex" in note for note in got.notes)


def test_a_length_decides() -> None:
    for length, data in ((6, bytes(6)), (4, b"\xaa" * 4)):
        for name in ("dlc", "len", "dataLength"):
            found, got = read([{"id": 5, "data": "AAAAAAAA", name: length}] * 2)
            assert [frame.data for frame in found] == [data] * 2
            assert not any("taken as hex" in note for note in got.notes)


def test_a_schema_or_a_name_decides() -> None:
    for coding, data in (("base64", bytes(6)), ("base64url", bytes(6)), ("base16", b"\xaa" * 4), ("hex", b"\xaa" * 4)):
        field = {"type": "string", "contentEncoding": coding}
        schema = {"properties": {"id": {"type": "integer"}, "data": field}}
        found, got = read([{"id": 5, "data": "AAAAAAAA"}], schema)
        assert ([frame.data for frame in found], got.notes[1:]) == (
            [data],
            ["time is header.stamp, log_time for 1 messages"],
        )
    for name, data in (("data_base64", bytes(6)), ("dataHex", b"\xaa" * 4)):
        assert [frame.data for frame in read([{"id": 5, name: "AAAAAAAA"}])[0]] == [data]


@pytest.mark.parametrize("count", [1, 63, 64, 200])
def test_what_stays_open_is_said(count: int) -> None:
    found, got = read([{"id": 5, "data": "AAAAAAAA"}] * count)
    assert [frame.data for frame in found] == [b"\xaa" * 4] * count
    assert f"/can0: {AS_HEX}" in got.notes
    found, got = read([{"id": "123", "data": [1]}] * count)
    assert [frame.id for frame in found] == [123] * count
    assert f"/can0: {AS_DECIMAL}" in got.notes


def test_a_coding_that_was_taken_stays() -> None:
    found, got = read([{"id": 5, "data": "AAAAAAAA"}] * 64 + [{"id": 5, "data": "AQEBAQEB"}] * 2)
    assert (len(found), got.lines["unreadable"]) == (64, 2)
    assert got.texts[0].endswith("message 65 of channel 1: not a hex digit in the data")


@pytest.mark.parametrize("form", ["%08X", "%x", "%03X", "0x%X"])
def test_identifiers_in_hex(form: str) -> None:
    for numbers in ([0x05040601, 0x0504061A, 0x123], [0x18504060, 0x18504061, 0x1850406C], [0x123, 0x124, 0x12F]):
        found, got = read([{"id": form % number, "data": [1]} for number in numbers])
        assert [frame.id for frame in found] == numbers
        assert not any("decimal" in note for note in got.notes)


def test_identifiers_in_decimal() -> None:
    numbers = [5, 291, 2047, 419_430_400]
    found, got = read([{"id": str(number), "data": [1]} for number in numbers])
    assert [frame.id for frame in found] == numbers
    assert not any("decimal" in note for note in got.notes)


def test_identifiers_are_never_half_and_half() -> None:
    found, got = read([{"id": "10", "data": [1]}] * 64 + [{"id": "1A", "data": [1]}])
    assert ([frame.id for frame in found], got.lines["unreadable"]) == ([10] * 64, 1)


@pytest.mark.parametrize("size", [1, 100, 1 << 20])
@pytest.mark.parametrize("chunked", [True, False])
def test_it_does_not_matter_how_the_file_is_cut(size: int, chunked: bool) -> None:
    """What decides may come with a later piece, or a later chunk; the file counts its messages itself."""
    values = [{"id": "18504060", "data": "AAAAAAAA"}] * 20 + [{"id": "1850406A", "data": "AQEBAQEB"}]
    got = from_pieces(cut(built(values, chunked=chunked, chunk_size=300), size))
    found = [frame for frame in got.frames if frame.bus == "can0"]
    assert [(frame.id, frame.data) for frame in found] == [(0x18504060, bytes(6))] * 20 + [(0x1850406A, b"\1" * 6)]
    assert (len(got.frames), got.damage) == (42, "")
