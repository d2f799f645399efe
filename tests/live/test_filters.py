"""Capture filters as candump writes them, and what they let through."""

from __future__ import annotations

import re
import struct

import can
import pytest

from analyzer.live.interfaces.filters import MOST, Filters, FrameFilter, parse_filters, split_filters

EXTENDED, REMOTE = 1 << 31, 1 << 30


class Socket:
    """Remembers its options."""

    def __init__(self) -> None:
        self.options: list[tuple[int, int, object]] = []

    def setsockopt(self, level: int, name: int, value: object) -> None:
        self.options.append((level, name, value))


def message(number: int, **more: bool) -> can.Message:
    return can.Message(arbitration_id=number, is_extended_id=number > 0x7FF, **more)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("texts", "expected"),
    [
        ([], Filters()),
        ([""], Filters()),
        (["123:7FF"], Filters((FrameFilter(0x123, 0x7FF),))),
        (["0x123:0x7ff"], Filters((FrameFilter(0x123, 0x7FF),))),
        (["123~7FF"], Filters((FrameFilter(0x123, 0x7FF, inverted=True),))),
        (["123:7FF, 92345678:DFFFFFFF"], Filters((FrameFilter(0x123, 0x7FF), FrameFilter(0x92345678, 0xDFFFFFFF)))),
        (["123:7FF", "124:7FF"], Filters((FrameFilter(0x123, 0x7FF), FrameFilter(0x124, 0x7FF)))),
        (["123~7FF,124~7FF,j"], Filters((FrameFilter(0x123, 0x7FF, True), FrameFilter(0x124, 0x7FF, True)), join=True)),
        (["00000123:1FFFFFFF"], Filters((FrameFilter(0x123, 0x1FFFFFFF),))),
        (["00000123:9FFFFFFF"], Filters((FrameFilter(EXTENDED | 0x123, 0x9FFFFFFF),))),
        (["123:C00007FF"], Filters((FrameFilter(0x123, 0xC00007FF),))),
        (["12345:9FFFFFFF"], Filters((FrameFilter(0x345, 0x800007FF),))),
        (["#FF"], Filters(errors=0xFF)),
        (["#1,#40", "1:1"], Filters((FrameFilter(1, 1),), errors=0x41)),
        (["#FFFFFFFF"], Filters(errors=0x1FFFFFFF)),
    ],
)
def test_what_is_meant(texts: list[str], expected: Filters) -> None:
    assert parse_filters(texts) == expected


@pytest.mark.parametrize(
    "text", ["123", "123:", ":7FF", "123:7FF:1", "xyz:7FF", "123456789:1", "#", "123:7FF;1:1", "!"]
)
def test_what_is_none(text: str) -> None:
    with pytest.raises(ValueError, match=re.escape(f"{text!r} is no filter: ID:MASK in hex as in 123:7FF")):
        parse_filters([text])


def test_bounds() -> None:
    assert len(parse_filters(["1:1"] * MOST).frames) == MOST
    with pytest.raises(ValueError, match="513 filters, 512 at most"):
        parse_filters(["1:1"] * (MOST + 1))
    with pytest.raises(ValueError, match="j joins filters"):
        parse_filters(["j"])


def test_an_interface_with_its_filters() -> None:
    assert split_filters("can0") == ("can0", "")
    assert split_filters("can0,123:7FF,#FF") == ("can0", "123:7FF,#FF")


@pytest.mark.parametrize(
    ("text", "taken", "refused"),
    [
        ("", [0x123, EXTENDED | 0x123, REMOTE | 1], []),
        ("#1", [0x123, EXTENDED | 0x123], []),
        ("123:7FF", [0x123, EXTENDED | 0x123, EXTENDED | 0x10923, REMOTE | 0x123], [0x122, EXTENDED | 0x124]),
        ("123~7FF", [0x122], [0x123, EXTENDED | 0x123]),
        ("123:C00007FF", [0x123], [EXTENDED | 0x123, REMOTE | 0x123]),
        ("00000123:9FFFFFFF", [EXTENDED | 0x123, EXTENDED | REMOTE | 0x123], [0x123, EXTENDED | 0x10923]),
        ("123:7FF,124:7FF", [0x123, 0x124], [0x125]),
        ("123~7FF,124~7FF", [0x123, 0x124, 0x125], []),
        ("123~7FF,124~7FF,j", [0x125], [0x123, 0x124]),
        ("12345:9FFFFFFF", [0x345], [EXTENDED | 0x12345]),
    ],
)
def test_what_is_taken(text: str, taken: list[int], refused: list[int]) -> None:
    filters = parse_filters([text])
    for words, expected in ((taken, True), (refused, False)):
        for word in words:
            frame = can.Message(
                arbitration_id=word & 0x1FFFFFFF,
                is_extended_id=bool(word & EXTENDED),
                is_remote_frame=bool(word & REMOTE),
            )
            assert filters.take(frame, 0) == expected, hex(word)


def test_error_frames_have_a_mask_of_their_own() -> None:
    error = message(0x7FF, is_error_frame=True)
    assert parse_filters(["123:7FF"]).take(error, 0x40)
    assert parse_filters(["#40"]).take(error, 0x48)
    assert not parse_filters(["#40"]).take(error, 0x8)
    assert not parse_filters(["#0"]).take(error, 0x1FFFFFFF)


def test_the_kernel_is_told() -> None:
    socket = Socket()
    parse_filters(["123:7FF,92345678~9FFFFFFF,j,#44"]).apply(socket)  # type: ignore[arg-type]
    words = struct.pack("=4I", 0x123, 0x7FF, 0xB2345678, 0x9FFFFFFF)
    assert socket.options == [(101, 6, 1), (101, 1, words), (101, 2, struct.pack("=I", 0x44))]


def test_the_kernel_is_told_what_is_let_through_without_a_rule() -> None:
    """What was held off before."""
    held = Socket()
    Filters.hold(held)  # type: ignore[arg-type]
    assert held.options == [(101, 1, b""), (101, 2, bytes(4))]
    errors, frames = Socket(), Socket()
    parse_filters(["#44"]).apply(errors)  # type: ignore[arg-type]
    assert errors.options == [(101, 1, bytes(8)), (101, 2, struct.pack("=I", 0x44))]
    parse_filters(["123:7FF"]).apply(frames)  # type: ignore[arg-type]
    assert frames.options == [(101, 1, struct.pack("=2I", 0x123, 0x7FF)), (101, 2, struct.pack("=I", 0x1FFFFFFF))]


def test_whether_anything_is_held_off() -> None:
    assert [bool(parse_filters([text])) for text in ("", "#0", "1:1")] == [False, True, True]
