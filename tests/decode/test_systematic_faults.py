"""A fault in every transfer of a session is told as a fault; the counters of other protocols are still foreign."""

from __future__ import annotations

import random
import re
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from kit.encode import Frame
from kit.judged import judge, whole
from kit.simulated import flight
from kit.strategies import examples
from kit.traffic import MS, at, lines, status

if TYPE_CHECKING:
    from collections.abc import Callable

SOT, EOT, TOGGLE = 0x80, 0x40, 0x20
ESCS = (11, 12, 13, 14)
RULES = ("TRF", "CAN")
LINE = re.compile(r"(\([\d.]+\) \w+ ([0-9A-F]{8})#)([0-9A-F]+)(.*\n)")
# A tail byte to what is sent in its place; nothing when the frame is never sent.
FAULTS: dict[str, Callable[[int], int | None]] = {
    "toggle 0": lambda tail: tail & ~TOGGLE,
    "toggle inverted": lambda tail: tail ^ TOGGLE,
    "no end": lambda tail: tail if tail & SOT else tail & ~EOT,
    "no start": lambda tail: tail if tail & EOT else tail & ~SOT,
    "no last frame": lambda tail: None if tail & (SOT | EOT) == EOT else tail,
    "no first frame": lambda tail: None if tail & (SOT | EOT) == SOT else tail,
}


def spoiled(text: str, fault: str, nodes: tuple[int, ...], types: tuple[int, ...] = ()) -> str:
    """The capture with the fault in all messages of these nodes, or in those of these types."""

    def sent(line: str) -> str:
        found = LINE.fullmatch(line)
        if not found:
            return line
        number, data = int(found[2], 16), bytes.fromhex(found[3])
        if number & 0xFF not in nodes or (types and number >> 8 & 0xFFFF not in types):
            return line
        tail = FAULTS[fault](data[-1])
        return "" if tail is None else found[1] + (data[:-1] + bytes((tail,))).hex().upper() + found[4]

    return "".join(sent(line) for line in text.splitlines(keepends=True))


@pytest.fixture(scope="module")
def sound() -> str:
    return flight(seconds=5, escs=4)


CASES: dict[str, tuple[str, tuple[int, ...], tuple[int, ...], str, int]] = {
    "toggles of one type never alternate": ("toggle 0", (12,), (1034,), "TRF-003", 12),
    "toggles of one type begin with 1": ("toggle inverted", (12,), (1034,), "TRF-002", 12),
    "no end of one type is marked": ("no end", (12,), (1034,), "TRF-006", 12),
    "no start of one type is marked": ("no start", (12,), (1034,), "TRF-005", 12),
    "the last frame of one type is never sent": ("no last frame", (12,), (1034,), "TRF-006", 12),
    "the first frame of one type is never sent": ("no first frame", (12,), (1034,), "TRF-005", 12),
    "single frames have toggle 1": ("toggle inverted", (10,), (1030,), "TRF-001", 10),
    "toggles of one node never alternate": ("toggle 0", (12,), (), "TRF-003", 12),
    "toggles of all ESCs never alternate": ("toggle 0", ESCS, (), "TRF-003", 14),
    "every NodeStatus has toggle 1": ("toggle inverted", (12,), (341,), "TRF-001", 12),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_the_fault_is_told(sound: str, case: str) -> None:
    fault, nodes, types, rule, node = CASES[case]
    text = spoiled(sound, fault, nodes, types)
    assert text != sound
    found = whole(text, RULES, (501,))
    told = [one for one in found if one.rule == rule and one.severity == "error" and one.node == node]
    assert told
    assert max(one.count for one in told) >= 5
    assert len({one.type for one in told}) == len(told)  # one run a type, not one a transfer
    assert [one for one in found if one.rule == "CAN-018"] == []
    assert [one.node for one in found if one.severity == "error" and one.node not in nodes] == []


def test_the_cause_is_named(sound: str) -> None:
    found = judge(spoiled(sound, "toggle 0", (12,), (1034,)), RULES)
    assert [one.cause for one in found if one.rule == "TRF-003"] == ["wrong toggle bit at the sender"]


@pytest.mark.parametrize("fault", [name for name in FAULTS if name != "toggle inverted"])
def test_the_node_need_not_be_known_otherwise(fault: str) -> None:
    text = lines(*([at(k * 100 * MS, frame) for frame in status(k % 32).frames()] for k in range(60))).decode()
    found = judge(spoiled(text, fault, (10,)), RULES)
    assert any(one.severity == "error" and one.node == 10 for one in found)
    assert [one for one in found if one.rule == "CAN-018"] == []


def counting_frames(text: str, node: int) -> str:
    """The capture with transfer IDs of this node that count up with every frame of a session."""
    counts: dict[int, int] = {}

    def sent(line: str) -> str:
        found = LINE.fullmatch(line)
        if not found or int(found[2], 16) & 0x7F != node:
            return line
        count = counts[int(found[2], 16)] = counts.get(int(found[2], 16), -1) + 1
        data = bytes.fromhex(found[3])
        return found[1] + (data[:-1] + bytes((data[-1] & 0xE0 | count & 31,))).hex().upper() + found[4]

    return "".join(sent(line) for line in text.splitlines(keepends=True))


@pytest.mark.slow
def test_transfer_ids_that_count_frames_are_told(sound: str) -> None:
    found = whole(counting_frames(sound, 12), RULES, (501,))
    told = {one.type: one.count for one in found if one.rule == "TRF-009" and one.node == 12}
    assert min(told[name] for name in ("ESCStatus", "PUSHCAN", "ParamGet")) >= 40
    assert [one for one in found if one.rule == "CAN-018"] == []
    assert [one.node for one in found if one.severity == "error" and one.node != 12] == []


def test_transfer_ids_that_count_frames_need_a_node_that_is_known() -> None:
    frames = [frame for k in range(60) for frame in status(k % 32).frames()]
    text = counting_frames(lines(frames).decode(), 10)
    assert {(one.rule, one.severity) for one in judge(text, RULES)} == {("CAN-018", "note")}


def test_toggles_that_begin_with_1_without_any_dronecan_are_cyphal() -> None:
    text = lines(*([at(k * 100 * MS, frame) for frame in status(k % 32).frames()] for k in range(60))).decode()
    found = judge(spoiled(text, "toggle inverted", (10,)), RULES)
    assert {(one.rule, one.severity) for one in found} == {("CAN-018", "note")}


# Known types under which others may send as well, from node 10, which speaks DroneCAN.
COLLIDING = [0x1F000000 | type_id << 8 | 10 for type_id in (341, 1030, 1033, 1038, 1039, 1332)]


def last_bytes(draw: Any) -> list[int]:
    """Those of 400 frames of another protocol."""
    high, low = draw(st.integers(0, 7)) << 5, draw(st.integers(0, 255))
    match draw(st.sampled_from(["random", "nibble", "checked", "alive", "state", "slow"])):
        case "random":
            numbers = random.Random(low)
            return [numbers.randrange(256) for _ in range(400)]
        case "nibble":
            return [low & 0xF0 | (low + k) & 0x0F for k in range(400)]
        case "checked":  # a counter below and a checksum above, as in TSC1 of J1939
            return [(k * 7 + low) % 16 << 4 | k & 0x0F for k in range(400)]
        case "alive":
            width = draw(st.sampled_from([1, 2, 3, 5]))
            return [high & 0x80 | (low + k) & (1 << width) - 1 for k in range(400)]
        case "state":
            states = draw(st.lists(st.integers(0, 255), min_size=1, max_size=4))
            dwell = draw(st.integers(1, 90))
            return [states[k // dwell % len(states)] for k in range(400)]
        case _:
            dwell = draw(st.integers(2, 30))
            return [low & 0x1F | high & 0x60 if k < dwell else (low + k // dwell) & 0x7F for k in range(400)]


FOREIGN = st.composite(last_bytes)()


def believable(tails: list[int]) -> bool:
    """Whether there is a legal frame of a transfer in it: that is the word of the sender."""
    return any(tail & 0xE0 in {SOT, SOT | EOT} for tail in tails)


@examples(150)
@given(FOREIGN, st.sampled_from(COLLIDING), st.randoms(use_true_random=False))
@example([0xE0 | k & 0x0F for k in range(400)], COLLIDING[0], random.Random(1))
def test_counters_and_signals_of_others_are_never_believed(
    decode: Callable[..., Any], tails: list[int], can_id: int, numbers: random.Random
) -> None:
    tails = [tail & 0x7F if believable([tail]) else tail for tail in tails]
    own = [frame for k in range(4) for frame in status(k).frames()]
    others = [Frame(can_id, numbers.randbytes(7) + bytes((tail,))) for tail in tails]
    got = decode(lines(own, others))
    assert got.verdicts == ["used"] * 12 + ["foreign"] * 400


@pytest.mark.sampled(3)
@pytest.mark.parametrize("alone", [True, False])
@pytest.mark.parametrize("can_id", COLLIDING)
@pytest.mark.parametrize("first", [0x00, 0x41, 0xA1, 0xE8])
def test_a_counter_of_eight_bits_is_never_believed(
    decode: Callable[..., Any], first: int, can_id: int, *, alone: bool
) -> None:
    own = [] if alone else [frame for k in range(4) for frame in status(k).frames()]
    others = [Frame(can_id, bytes((k % 7,)) * 7 + bytes(((first + k) % 256,))) for k in range(600)]
    got = decode(lines(own, others))
    assert got.verdicts == ["used"] * len(own) + ["foreign"] * 600
