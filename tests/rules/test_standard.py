"""Payloads against their types: TYP-001 to -005, -007, -008, -011 and -012 of any type."""

from __future__ import annotations

from dataclasses import replace

import pytest
from kit import VECTORS, encode
from kit.judged import exact, judge, whole
from kit.simulated import flight
from kit.traffic import STATUS, lines, status
from witness import finder
from witness.reader import Log

RULES = ("TYP-001", "TYP-002", "TYP-003", "TYP-004", "TYP-005", "TYP-007", "TYP-008", "TYP-011", "TYP-012")
TEXTS = {
    "TYP-001": "13 bytes, at least 14 needed",
    "TYP-002": "15 bytes, at most 14 allowed",
    "TYP-003": "2 bits left over, value 1",
    "TYP-004": "8 bytes: 4 elements and 8 bits left over",
    "TYP-005": "cmd: 21 elements, at most 20",
    "TYP-007": "temperature is NaN (0x7E00)",
    "TYP-008": "temperature is infinite (0x7C00)",
    "TYP-011": "value: tag 7, 5 members",
    "TYP-012": "5 void bits, value 1",
}


def logged(*sent: encode.Transfer) -> bytes:
    return lines(*(one.frames() for one in sent))


def cut(one: encode.Transfer, payload: bytes) -> encode.Transfer:
    return replace(one, payload=payload)


@pytest.mark.slow
@pytest.mark.parametrize("rule", RULES)
def test_a_fault_of_the_simulator_is_found_where_the_witness_finds_it(rule: str) -> None:
    text = flight(f"{rule}@1")
    said = judge(text, RULES)
    (mine,) = [one for one in said if one.rule == rule]
    assert mine.count == 1
    assert mine.text == TEXTS[rule]
    assert exact(rule, text) == [mine]
    also = {"TYP-002"} if rule == "TYP-005" else set()
    assert {one.rule for one in said} - {rule} == also


@pytest.mark.slow
@pytest.mark.parametrize("rule", RULES)
def test_nothing_depends_on_the_batches(rule: str) -> None:
    assert whole(flight(f"{rule}@1"), RULES, (7,))


@pytest.mark.parametrize("file", ["violations.log", "tm_golden.log", "tm_golden_fd.log"])
def test_the_frames_are_those_of_the_witness(file: str) -> None:
    text = (VECTORS / file).read_text()
    said, log = judge(text, RULES), Log(text)
    for rule in RULES:
        places = {frame for one in said if one.rule == rule for frame in one.frames}
        assert places == {min(frames) for frames in finder(rule)(log)}, rule


def test_a_clean_flight_has_none() -> None:
    assert judge(flight(seconds=2), RULES) == []


def test_a_length_that_a_prefix_explains_is_not_too_long() -> None:
    bare = encode.transfer("RawCommand", {"cmd": [0] * 20}, 1)
    whole = cut(bare, b"\x14" + bare.payload)  # 36 bytes
    assert judge(logged(whole), ("TYP-002",)) == []
    (found,) = judge(logged(cut(bare, bare.payload + b"\x01")), ("TYP-002",))
    assert found.text == "36 bytes, at most 35 allowed without the length field, which is not sent"


def test_elements_that_fit_are_counted_beyond_the_most() -> None:
    bare = encode.transfer("RawCommand", {"cmd": [0] * 20}, 1)
    found = judge(logged(cut(bare, bare.payload + bytes(5))), ("TYP-004", "TYP-005"))
    assert [(one.rule, one.text) for one in found] == [
        ("TYP-004", "40 bytes: 22 elements and 12 bits left over"),
        ("TYP-005", "cmd: 22 elements, at most 20"),
    ]


def test_a_length_field_above_the_most() -> None:
    sent = encode.transfer("RawCommand", {"cmd": [0] * 20}, 1, fd=True)
    assert judge(logged(sent), RULES) == []
    more = cut(sent, bytes([sent.payload[0] | 0xA8]) + sent.payload[1:])  # 5 bits: 21
    (found,) = judge(logged(more), ("TYP-005",))
    assert found.text == "cmd: 21 elements, at most 20"


def test_only_the_bits_behind_the_last_field_are_padding() -> None:
    sent = status(1)
    dirty = cut(sent, sent.payload[:-1] + bytes([sent.payload[-1] | 3]))
    (found,) = judge(logged(status(0), dirty, status(2)), ("TYP-003",))
    assert (found.frames, found.text) == ((4,), "2 bits left over, value 3")
    assert judge(logged(cut(sent, sent.payload[:-1] + bytes([sent.payload[-1] | 4]))), ("TYP-003",)) == []


def test_floats_inside_structures_and_lists_are_named_once_a_transfer() -> None:
    fix = {"covariance": [1.0, float("nan"), float("nan")], "ned_velocity": [0.0, float("-inf"), 0.0], "pdop": 1.5}
    fix |= {"timestamp": {"usec": 1}, "gnss_timestamp": {"usec": 1}, "ecef_position_velocity": []}
    names = [field for field, *_ in encode.parse(encode.TYPES["uavcan.equipment.gnss.Fix2"].layout)[1]]
    sent = encode.transfer("uavcan.equipment.gnss.Fix2", {name: fix.get(name, 0) for name in names}, 20)
    found = judge(logged(sent), ("TYP-007", "TYP-008"))
    assert sorted((one.rule, one.key, one.text, one.count) for one in found) == [
        ("TYP-007", "field=covariance", "covariance is NaN (0x7E00)", 1),
        ("TYP-008", "field=ned_velocity", "ned_velocity is infinite (0xFF800000)", 1),
    ]


def test_floats_of_a_damaged_transfer_break_no_rule() -> None:
    sent = encode.transfer("ESCStatus", STATUS | {"voltage": float("nan"), "esc_index": 0}, 10).frames()
    assert judge(lines(sent), ("TYP-007",)) != []
    sent[0] = replace(sent[0], data=bytes([sent[0].data[0] ^ 1]) + sent[0].data[1:])
    assert judge(lines(sent), ("TYP-007",)) == []
