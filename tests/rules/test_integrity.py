"""Broken sequences, CRCs and padding in captures: what is said, where, and that batches do not matter."""

from __future__ import annotations

import random
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit import VECTORS, encode
from kit.encode import Frame, Transfer, log_line
from kit.judged import Said, judge, whole
from kit.simulated import flight
from kit.strategies import examples
from witness import finder
from witness.reader import Log

from analyzer.rules.diagnosis import budgets
from analyzer.rules.transfers import wrong_crc

RULES = ("TRF-003", "TRF-010", "TRF-011", "TRF-030", "TRF-031", "CAN-020")
SIGNATURE = 0xA9AF28AEA2FBB254
MILLISECOND = 1_000_000
VECTORS = VECTORS / "violations.log"


def text(*groups: list[Frame]) -> str:
    """Frames as a capture, 1 ms apart."""
    frames = [frame for group in groups for frame in group]
    return "".join(log_line(replace(frame, t=k * MILLISECOND)) + "\n" for k, frame in enumerate(frames))


def status(number: int, payload: bytes | None = None, **more: object) -> list[Frame]:
    """A report of 14 bytes; `number` is its transfer ID and makes its content."""
    body = bytes((number, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13 + number)) if payload is None else payload
    return Transfer("message", 1034, 10, body, SIGNATURE, number % 32, **more).frames()  # type: ignore[arg-type]


def good(count: int = 3, first: int = 0) -> list[Frame]:
    return [frame for number in range(first, first + count) for frame in status(number)]


def found(capture: str) -> list[Said]:
    """What the rules say, the same for every batch size."""
    return whole(capture, RULES)


def brief(capture: str) -> list[tuple[str, str, int, tuple[int, ...]]]:
    return [(one.rule, one.text, one.count, one.frames) for one in found(capture)]


def test_nothing_is_said_of_good_transfers() -> None:
    assert found(text(good(40), status(40)[:2])) == []


def test_a_lost_frame_is_placed() -> None:
    capture = text(good(3), [status(3)[0], status(3)[2]], good(3, 4))
    assert brief(capture) == [("TRF-003", "one frame lost (the 2nd of 3), before frame 11", 1, (10,))]
    (one,) = found(capture)
    assert (one.severity, one.node, one.type, one.key) == ("error", 10, "ESCStatus", "cause=one frame lost")


def test_frames_that_the_recorder_lost_make_it_a_note() -> None:
    lines = text(good(3), [status(3)[0], status(3)[2]], good(3, 4)).splitlines(keepends=True)
    capture = "".join([*lines[:10], encode.drop_line("can0", 1, 1) + "\n", *lines[10:]])
    assert [(one.rule, one.severity) for one in found(capture)] == [("TRF-003", "note")]


@pytest.mark.sampled(2)
@pytest.mark.parametrize("foreign", [0, 5, 40])
def test_a_swapped_frame_is_found_behind_the_end(foreign: int) -> None:
    first, second, third = status(3)
    others = [Frame(0x123, bytes(3), extended=False)] * foreign
    capture = text(good(3), [first, third], others, [second], good(30, 4))
    late = 12 + foreign
    (one,) = found(capture)
    assert one.text == f"frames swapped (right order: 10, {late}, 11), before frame 11"
    assert one.key == "cause=frames swapped"


def test_a_frame_that_comes_too_late_is_lost() -> None:
    first, second, third = status(3)
    capture = text(good(3), [first, third], [Frame(0x123, bytes(3), extended=False)] * 70, [second], good(3, 4))
    assert [one.key for one in found(capture)] == ["cause=one frame lost"]


def test_the_first_frame_may_come_second() -> None:
    first, second, third = status(3)
    (one,) = found(text(good(3), [second, first, third], good(3, 4)))
    assert one.text == "frames swapped (right order: 11, 10, 12), before frame 12"


@pytest.mark.slow
def test_a_wrong_toggle_and_the_end_of_the_capture() -> None:
    first, second, third = status(3)
    flipped = replace(second, data=second.data[:-1] + bytes((second.data[-1] ^ 0x20,)))
    expected = [("TRF-003", "wrong toggle bit at the sender, before frame 11", 1, (10,))]
    assert brief(text(good(3), [first, flipped, third])) == expected
    assert brief(text(good(3), [first, flipped, third], good(60, 4))) == expected


def test_two_senders_of_one_identity() -> None:
    mine, theirs = status(3), status(3, bytes(range(60, 74)))
    mixed = [frame for pair in zip(mine, theirs, strict=True) for frame in pair]
    causes = [one.cause for one in found(text(good(3), mixed, good(3, 4))) if one.rule == "TRF-003"]
    assert causes == ["frames of another sender in between"]


def test_nothing_is_proven_of_an_unknown_type() -> None:
    def of(number: int) -> list[Frame]:
        return Transfer("message", 20999, 10, bytes(range(number, number + 14)), 0x1234567, number).frames()

    frames = [frame for number in range(5) for frame in of(number)]
    first, second, third = of(5)
    for came, cause in (([first, third], "one frame lost"), ([first, third, second], "a frame lost or out of order")):
        assert [one.cause for one in found(text(frames, came)) if one.rule == "TRF-003"] == [cause]


@pytest.mark.slow
def test_causes_are_sought_for_a_bounded_number(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(budgets, "MOST_SEARCHES", 3)
    cut = [[status(k)[0], status(k)[2]] for k in range(3, 8)]
    capture = text(good(3), *cut, good(30, 8))
    assert brief(capture) == [
        ("TRF-003", "one frame lost (the 2nd of 3), before frame 11", 5, (10, 12, 14, 16, 18)),
    ]
    wrong = [Transfer("message", 1034, 10, bytes(14), 1, k % 32).frames() for k in range(3, 8)]
    counts = {(one.rule, one.cause): one.count for one in found(text(good(3), *wrong))}
    mistake = f"wrong signature, a CRC that starts from {encode.signature_crc(1):04X}"
    assert counts == {("TRF-010", mistake): 5, ("TRF-011", mistake): 5}
    unsigned = [_seeded(0xFFFF, k) for k in range(3, 8)]
    counts = {(one.rule, one.cause): one.count for one in found(text(good(3), *unsigned))}
    assert counts == {("TRF-010", "no signature"): 5, ("TRF-011", "no signature"): 5}


def test_one_wrong_crc_is_doubtful_without_a_right_one_nearby() -> None:
    wrong = _seeded(0x1234, 3)
    assert [one.cause for one in found(text(wrong, good(3, 4)))] == ["corrupted"]
    quiet = [Frame(0x123, bytes(3), extended=False)] * 2100
    capture = text(good(3), quiet, wrong, quiet[:600], good(3, 4))
    assert [one.cause for one in whole(capture, RULES, (100,))] == ["corrupted, or a wrong signature"]


def test_a_mistake_that_was_found_needs_no_search(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(budgets, "MOST_SEARCHES", 1)
    quiet = [Frame(0x123, bytes(3), extended=False)] * 520
    early, late = ([_seeded(0xFFFF, k) for k in numbers] for numbers in (range(3, 6), range(6, 11)))
    capture = text(good(3), *early, quiet, *late, [_seeded(0x1234, 11)][0])
    counts = {(one.rule, one.cause): one.count for one in whole(capture, RULES, (7, 100))}
    said = {("TRF-010", "no signature"): 8, ("TRF-011", "no signature"): 8}
    assert counts == {**said, ("TRF-010", budgets.NOT_SEARCHED): 1}


def test_what_one_turned_bit_explains_needs_no_search(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(budgets, "MOST_SEARCHES", 2)
    calls, look = [], wrong_crc.ask
    monkeypatch.setattr(wrong_crc, "ask", lambda *given: calls.append(len(given[2].code)) or look(*given))
    wrong = []
    for k in range(3, 27):
        first, second, third = status(k)
        turned = bytes((second.data[0] ^ 1 << k % 8,)) + second.data[1:]
        wrong += [first, replace(second, data=turned), third]
    (one,) = judge(text(good(3), wrong, good(30, 27)), RULES)
    assert (one.rule, one.cause, one.count) == ("TRF-010", "corrupted", 24)
    assert "one bit turned in byte 1 of frame 11" in one.text
    assert sum(calls) == 2


def _seeded(start: int, number: int) -> list[Frame]:
    """A report whose CRC begins with another value."""
    body = bytes((*range(number, number + 13), 7))
    first, *rest = status(number, body)
    return [replace(first, data=encode.crc16(body, start).to_bytes(2, "little") + first.data[2:]), *rest]


@pytest.mark.parametrize("most", [3, 1000])
def test_wrong_crcs_are_told_together_as_one_by_one(monkeypatch: pytest.MonkeyPatch, most: int) -> None:
    """Damage of every kind, by chance one that a mistake gives, too."""
    monkeypatch.setattr(budgets, "MOST_SEARCHES", most)
    chance, wrong = random.Random(5), []
    for k in range(3, 120):
        frames = status(k)
        for at in chance.sample(range(3), chance.choice((1, 1, 1, 3))):
            body = bytearray(frames[at].data)
            body[0] ^= chance.choice((1 << k % 8, 0x5A))
            frames[at] = replace(frames[at], data=bytes(body))
        wrong += frames if k % 5 else [frames[0], replace(frames[1], data=frames[1].data[2:]), frames[2]]
        wrong += _seeded(0, k) if k in {50, 90} else status(k + 1)
    capture, calm = text(good(3), wrong, good(30, 3)), wrong_crc.WrongCrcs._calm
    told: list[int] = []

    def counted(*given: Any) -> Any:
        found = calm(*given)
        told.append(len(found))
        return found

    def none(*_given: Any) -> Any:
        return np.empty(0, np.int64)

    monkeypatch.setattr(wrong_crc.WrongCrcs, "_calm", counted)
    together = judge(capture, RULES, 60)
    assert sum(told) > 2
    monkeypatch.setattr(wrong_crc.WrongCrcs, "_calm", none)
    assert together == judge(capture, RULES, 60)
    assert {one.rule for one in together} >= {"TRF-010"}


def test_a_crc_with_the_signature_of_another_name() -> None:
    start = encode.signature_crc(0xC67490B59FD75681)
    said = {one.rule: one for one in found(text(good(3), _seeded(start, 3), good(3, 4)))}
    assert said["TRF-011"].text == "fits with: the signature of com.tmotor.esc.Status"
    assert said["TRF-011"].frames == said["TRF-010"].frames == (10,)
    assert len(said) == 2


def test_the_blocks_of_the_vectors() -> None:
    said = {(one.rule, one.first): (one.cause, one.count) for one in judge(VECTORS.read_text(), RULES)}
    assert said == {
        ("TRF-003", 9): ("one frame lost", 1),
        ("TRF-003", 14): ("frames swapped", 1),
        ("TRF-010", 28): ("corrupted", 1),
        ("TRF-010", 34): ("no signature", 1),
        ("TRF-010", 37): ("zero padding", 1),
        ("TRF-011", 34): ("no signature", 1),
        ("TRF-011", 37): ("zero padding", 1),
    }


def padded(filling: bytes, number: int = 3) -> list[Frame]:
    """A CAN FD report of 14 bytes in one frame."""
    (frame,) = status(number, fd=True)
    return [replace(frame, data=frame.data[:14] + filling + frame.data[-1:])]


@pytest.mark.parametrize(("filling", "said"), [
    (b"\0", None),
    (b"\xa5", "1 padding bytes, 1 needed, first A5"),
    (bytes(5), "5 padding bytes, 1 needed, first 00"),
    (b"\0\0\0\0\x7f", "5 padding bytes, 1 needed, first 7F"),
])  # fmt: skip
def test_padding_of_can_fd(filling: bytes, said: str | None) -> None:
    usual = [frame for number in range(3) for frame in padded(b"\0", number)]
    assert [(one.text, one.frames) for one in found(text(usual, padded(filling)))] == ([(said, (4,))] if said else [])


@examples(30)
@given(st.integers(0, 80))
def test_the_padding_of_a_long_can_fd_transfer_is_right(length: int) -> None:
    fields = {"level": {"value": 1}, "source": b"a", "text": bytes([65]) * length}
    frames = encode.transfer("uavcan.protocol.debug.LogMessage", fields, 10, 1, fd=True).frames()
    assert judge(text(frames), ("TRF-030",)) == []


def unknown(number: int, flip: int = 0, src: int = 10, signature: int = 0x1122334455667788) -> list[Frame]:
    """A transfer of a type that nobody knows."""
    frames = Transfer("message", 20999, src, bytes(range(number, number + 16)), signature, number % 32).frames()
    data = frames[-1].data
    return [*frames[:-1], replace(frames[-1], data=bytes((data[0] ^ flip,)) + data[1:])]


def test_the_start_value_of_an_unknown_type() -> None:
    start = encode.signature_crc(0x1122334455667788)
    capture = text(*(unknown(k, flip=k in {0, 4}) for k in range(9)), unknown(0, src=11), unknown(1, src=11))
    wrong = [one for one in found(capture) if one.rule == "TRF-010"]
    assert [(one.node, one.count, one.frames) for one in wrong] == [(10, 2, (1, 13))]
    here = encode.crc16(bytes((*range(12), 12 ^ 1, 13, 14, 15)), start)
    assert wrong[0].text.endswith(f"computed {here:04X}: corrupted (one bit turned in byte 1 of frame 3)")
    notes = [(one.node, one.text, one.first, one.severity) for one in found(capture) if one.rule == "TRF-031"]
    assert notes == [
        (10, f"start value {start:04X} in 7 transfers", 4, "note"),
        (11, f"start value {start:04X} in 2 transfers", 28, "note"),
    ]


def test_a_start_value_may_be_that_of_a_known_type() -> None:
    (one,) = found(text(*(unknown(k, signature=SIGNATURE) for k in range(4))))
    assert one.text == "start value 1591 in 4 transfers, like uavcan.equipment.esc.Status"


def test_values_that_agree_by_chance_prove_nothing() -> None:
    """Two equal values among many transfers with a checksum of another kind."""
    signatures = [*range(1, 41), 1]
    assert found(text(*(unknown(k % 200, signature=value) for k, value in enumerate(signatures)))) == []


def test_another_type_with_this_id_is_named() -> None:
    known = Transfer("message", 1000, 10, bytes((*range(1, 15), 0, *range(6), 0, *range(7))), 0x1362AB78CD12F03A, 1)
    said = {one.rule: one for one in found(text(known.frames()))}
    assert said["CAN-020"].text == "ID 1000 is CloudLink by its CRC, not uavcan.equipment.ahrs.Solution"
    assert set(said) == {"CAN-020", "TRF-010"}


ORDERS = [
    *(f"TRF-003@1.2:how={how}" for how in ("flip", "lost", "swapped")), "TRF-009@1.2", "TRF-010@1.2:count=4",
    *(f"TRF-011@1.2:how={how}" for how in ("nosignature", "swapped", "trailing", "padding")),
    *(f"TRF-011@1.2:how={how}" for how in ("reversed", "fromzero", "finalxor")),
    "TRF-030@1.2:how=nonzero", "TRF-030@1.2:how=long", "TRF-031@1.2", "CAN-020@1.2", "TRF-012@1.2",
]  # fmt: skip


@pytest.mark.sampled(7)
@pytest.mark.parametrize("order", ORDERS)
def test_what_the_witness_finds(order: str) -> None:
    capture = flight(order, seconds=2)
    said, log = whole(capture, RULES, (501,)), Log(capture)
    assert said or order == "TRF-012@1.2"
    for rule in RULES:
        wanted = finder(rule)(log)
        shown = [number for one in said if one.rule == rule for number in one.frames]
        assert all(any(number in frames for number in shown) for frames in wanted), rule
        if order != "CAN-020@1.2" or rule != "TRF-010":  # the witness does not check the CRC of that type
            assert all(any(number in frames for frames in wanted) for number in shown), rule
