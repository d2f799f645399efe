"""TYP-105: throttles of 16 bits where 14 belong, told from the stream, and what only looks a little like them."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING

import pytest
from kit import encode
from kit.encode import Transfer, log_line
from kit.judged import judge, proved, whole
from kit.simulated import flight

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

RULE = ("TYP-105",)
Stream = list[list[int]]
COUNT = 40


def text(payloads: Iterable[bytes]) -> str:
    """RawCommand of these payloads at 400 Hz."""
    kind = encode.TYPES["RawCommand"]
    frames = [
        frame
        for k, payload in enumerate(payloads)
        for frame in Transfer("message", kind.type_id, 1, payload, kind.signature, k % 32).frames(k * 2_500_000)
    ]
    return "".join(log_line(frame) + "\n" for frame in frames)


def words(channels: Sequence[int]) -> bytes:
    """The mistake: 16 bits a channel, low byte first."""
    return b"".join(value.to_bytes(2, "little", signed=True) for value in channels)


def right(channels: Sequence[int]) -> bytes:
    payload: bytes = encode.transfer("RawCommand", {"cmd": list(channels)}, 1).payload
    return payload


def steady(channels: int, _: random.Random) -> Stream:
    return [[1000] * channels] * COUNT


def ramp(channels: int, _: random.Random) -> Stream:
    return [[300 + 61 * k] * channels for k in range(COUNT)]


def flown(channels: int, dice: random.Random) -> Stream:
    return [[round(3900 + 40 * ch + dice.gauss(0, 60)) for ch in range(channels)] for _ in range(COUNT)]


def jumping(channels: int, dice: random.Random) -> Stream:
    return [[dice.randrange(8192) for _ in range(channels)] for _ in range(COUNT)]


def both_ways(channels: int, dice: random.Random) -> Stream:
    return [[dice.randrange(-8191, 8192) for _ in range(channels)] for _ in range(COUNT)]


def reversed_(channels: int, dice: random.Random) -> Stream:
    return [[round((-1) ** ch * 2500 + dice.gauss(0, 60)) for ch in range(channels)] for _ in range(COUNT)]


def backwards(channels: int, _: random.Random) -> Stream:
    return [[-700] * channels] * COUNT


def idle(channels: int, _: random.Random) -> Stream:
    return [[500] * channels] * COUNT


def bench(channels: int, _: random.Random) -> Stream:
    return [[200 * k if ch == channels // 2 else 0 for ch in range(channels)] for k in range(COUNT)]


def stairs(channels: int, _: random.Random) -> Stream:
    return [[(0, 1638, 3276, 4914, 6552, 8191)[k // 8 % 6]] * channels for k in range(COUNT)]


STREAMS = (steady, ramp, flown, jumping, both_ways, reversed_, backwards, idle, stairs)


@pytest.mark.sampled(11)
@pytest.mark.parametrize("channels", range(1, 9))
@pytest.mark.parametrize("stream", STREAMS)
def test_words_are_recognised(stream: Callable[[int, random.Random], Stream], channels: int) -> None:
    sent = stream(channels, random.Random(channels))
    (one,) = whole(text(map(words, sent)), RULE, (7,))
    assert (one.severity, one.node, one.type) == ("warning", 1, "RawCommand")
    assert one.count >= COUNT / 4
    shown = ", ".join(map(str, sent[0]))
    assert one.text.startswith("as a word " if channels == 1 else "as words ")
    if stream in (steady, backwards, idle):
        assert f" {shown}, as sent " in one.text
        assert one.count == COUNT


@pytest.mark.sampled(29)
@pytest.mark.parametrize("channels", range(1, 21))
@pytest.mark.parametrize("stream", [*STREAMS, bench])
def test_what_is_packed_right_is_not_suspected(stream: Callable[[int, random.Random], Stream], channels: int) -> None:
    for seed in range(3):
        assert judge(text(map(right, stream(channels, random.Random(seed)))), RULE) == []


@pytest.mark.slow
def test_constant_throttles_are_not_suspected() -> None:
    """Those of seven words and eight channels have no padding, and a constant one may look like another."""
    dice = random.Random(2)
    for channels in (8, 9) * 50:
        sent = [[dice.randrange(8192) for _ in range(channels)]] * 12
        assert judge(text(map(right, sent)), RULE) == []


def test_seven_are_not_enough_and_zeros_say_nothing() -> None:
    def found(*payloads: bytes) -> int:
        return sum(one.count for one in whole(text(payloads), RULE, (5,)))

    word, zero, fine = words([1000] * 4), bytes(8), right([3000] * 4)
    assert found(*[word] * 7) == 0
    assert found(*[word] * 8) == 8
    assert found(*[word] * 4, *[zero] * 9, *[word] * 4) == 8
    assert found(*[zero] * 50) == found(*[bytes(2)] * 50) == found(*[bytes(14)] * 50) == 0
    assert found(*[word] * 4, fine + b"\0", *[word] * 4) == 0  # 3000 in 14 bits is no word
    assert found(*[word] * 9, fine + b"\0", *[word] * 7) == 9


def test_padding_that_stays_the_same_is_no_word() -> None:
    """14 bits with ones behind them: a value that goes up is far from steady as a word."""
    sent = [right([20 * k]) for k in range(COUNT)]
    assert judge(text(payload[:-1] + bytes([payload[-1] | 3]) for payload in sent), RULE) == []


def test_a_frame_of_zeros_behind_14_bits_is_no_word() -> None:
    assert judge(text(right([2500 + k] * 4) + b"\0" for k in range(COUNT)), RULE) == []


def test_one_word_of_a_motor_that_is_tried_alone() -> None:
    """Ch2 at exactly 64 while the others stand is throttle, not a word."""
    assert judge(text(right([0, k, 0, 0]) for k in range(200)), RULE) == []


@pytest.mark.slow
@pytest.mark.parametrize("escs", [4, 6])
def test_a_fault_is_found_where_the_witness_finds_it(escs: int) -> None:
    (one,) = proved("TYP-105", flight("TYP-105@2:how=array:commands=16", escs=escs, seconds=4))
    assert one.count == 16
