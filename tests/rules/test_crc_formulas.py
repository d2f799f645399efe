"""TRF-011: transfer CRCs that are computed in another way than 5.1 says, and damage that only looks like it."""

from __future__ import annotations

import random
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from kit import encode
from kit.encode import Frame, Transfer, crc16, log_line
from kit.judged import Said, whole

from analyzer.rules.diagnosis import budgets

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

MILLISECOND = 1_000_000
RULES = ("TRF-010", "TRF-011")
# A type, its payloads (of several lengths where it has some), and another type.
KINDS = {
    "ESCStatus": ((14,), "ParamCfg"), "RawCommand": ((9, 14, 35), "ESCStatus"), "ParamCfg": ((27,), "ParamGet"),
    "PUSHSCI": ((11, 16, 35), "PUSHCAN"), "PUSHCAN": ((32, 59), "PUSHSCI"), "ParamGet": ((41, 73), "RawCommand"),
}  # fmt: skip


def signature(name: str) -> bytes:
    return encode.TYPES[name].signature.to_bytes(8, "little")


WAYS: dict[str, Callable[[str, bytes], int]] = {
    "the bytes of the signature in reversed order": lambda name, data: crc16(signature(name)[::-1] + data),
    "a CRC that starts from 0 in front of the signature": lambda name, data: crc16(signature(name) + data, 0),
    "a final XOR with FFFF": lambda name, data: crc16(signature(name) + data) ^ 0xFFFF,
    "no signature, a CRC that starts from 0": lambda _, data: crc16(data, 0),
    "the signature of uavcan.equipment.esc.": lambda name, data: crc16(signature(KINDS[name][1]) + data),
}
BY_TWO = pytest.mark.parametrize("way", WAYS)


def payload(name: str, number: int) -> bytes:
    sizes, _ = KINDS[name]
    return random.Random(number).randbytes(sizes[number % len(sizes)])


def sent(name: str, number: int, way: str = "", flip: int = 0) -> list[Frame]:
    """One transfer; `flip` is what became of its last payload byte."""
    data = payload(name, number)
    frames = Transfer(
        "message", encode.TYPES[name].type_id, 10, data, encode.TYPES[name].signature, number % 32
    ).frames()
    first, last = frames[0], frames[-1]
    frames[-1] = replace(last, data=bytes((last.data[0] ^ flip,)) + last.data[1:])
    if way:
        frames[0] = replace(first, data=WAYS[way](name, data).to_bytes(2, "little") + first.data[2:])
    return frames


QUIET = [Frame(0x123, bytes(3), extended=False)] * 150


def text(groups: Sequence[list[Frame]], noise: int = 0) -> str:
    frames = [frame for group in groups for frame in [*group, *QUIET[:noise]]]
    return "".join(log_line(replace(frame, t=k * MILLISECOND)) + "\n" for k, frame in enumerate(frames))


def said(capture: str, steps: tuple[int, ...] = (7,)) -> list[tuple[str, str, int]]:
    found: list[Said] = whole(capture, RULES, steps)
    return [(one.rule, one.cause.partition("esc.")[0] + "esc." * ("esc." in one.cause), one.count) for one in found]


@pytest.mark.sampled(8)
@pytest.mark.parametrize("noise", [0, 150])
@pytest.mark.parametrize("name", KINDS)
@BY_TWO
def test_a_mistake_of_every_transfer_is_named_from_the_first_one_on(way: str, name: str, noise: int) -> None:
    capture = text([sent(name, number, way) for number in range(6)], noise)
    assert said(capture) == [("TRF-010", way, 6), ("TRF-011", way, 6)]


@pytest.mark.sampled(5)
@BY_TWO
def test_two_of_a_seldom_type_are_enough(way: str) -> None:
    """They are further apart than what is looked at around each."""
    apart = [QUIET * 20]
    capture = text(
        [
            *(sent("ESCStatus", k) for k in range(3)),
            *(part for k in (4, 5) for part in (sent("ParamGet", k, way), *apart)),
        ]
    )
    assert said(capture, (997,)) == [("TRF-010", way, 2), ("TRF-011", way, 2)]


@BY_TWO
def test_one_alone_proves_nothing(way: str) -> None:
    capture = text([*(sent("ESCStatus", k) for k in range(3)), sent("ESCStatus", 3, way), sent("ESCStatus", 4)])
    assert said(capture) == [("TRF-010", "corrupted", 1)]
    first, *others = WAYS
    second = others[0] if way == first else first
    capture = text([sent("ESCStatus", 3, way), sent("ESCStatus", 4), sent("ESCStatus", 5, second)])
    assert [rule for rule, *_ in said(capture)] == ["TRF-010"]


@BY_TWO
def test_other_damage_in_between_breaks_the_proof_only_until_two_agree(way: str) -> None:
    """Three damaged, one wrong, one damaged, then wrong ones only."""
    kinds = [sent("ESCStatus", k, flip=0x5A) for k in range(3)] + [
        sent("ESCStatus", 3, way),
        sent("ESCStatus", 4, flip=0x33),
    ]
    counts = said(text([*kinds, *(sent("ESCStatus", k, way) for k in range(5, 9))]))
    assert ("TRF-011", way, 4) in counts
    assert sum(count for rule, _, count in counts if rule == "TRF-010") == 9


@pytest.mark.slow
def test_random_damage_gets_no_such_cause() -> None:
    dice = random.Random(9)
    groups = []
    for number in range(600):
        frames = sent("PUSHCAN", number)
        at = dice.randrange(1, len(frames))
        frames[at] = replace(frames[at], data=dice.randbytes(len(frames[at].data) - 1) + frames[at].data[-1:])
        groups.append(frames)
    assert {rule for rule, *_ in said(text(groups), ())} == {"TRF-010"}


def test_what_is_known_of_a_sender_is_not_sought_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(budgets, "MOST_SEARCHES", 2)
    way = "a final XOR with FFFF"
    assert said(text([sent("PUSHCAN", k, way) for k in range(40)])) == [("TRF-010", way, 40), ("TRF-011", way, 40)]
