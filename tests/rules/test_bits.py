"""Tail bytes with wrong start, end, toggle or ID bits, and senders whose every transfer breaks in the same way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from kit.encode import Frame, log_line
from kit.judged import whole
from kit.oracle.neighbours import missing
from kit.oracle.proofs import KnownType, Part, in_a_row
from rules.test_diagnosis import FIXED, START, broken_sequence, expected, numbered, payloads, sent
from rules.test_integrity import good, status, text

from analyzer.rules.diagnosis import budgets, causes


@pytest.mark.parametrize(("size", "frames", "total"), [(14, 4, 3), (2, 3, 1)])
def test_too_many_frames_are_not_a_negative_number_of_lost_ones(size: int, frames: int, total: int) -> None:
    parts = sent(bytes(7 * frames - 4))
    assert missing(parts, KnownType([START], size)) == (causes.TOO_MANY, f" ({frames} instead of {total})")


def test_two_equal_frames_may_be_swapped_or_have_wrong_toggles() -> None:
    parts = sent(bytes([0xFF]) * 24)
    swapped = [parts[0], parts[2], parts[1], parts[3]]
    assert broken_sequence(numbered(swapped), [], expected()).what == causes.EITHER
    parts[1] = parts[1]._replace(tail=parts[1].tail ^ 0x20)
    assert broken_sequence(numbered(parts), [], expected()).what == causes.WRONG_BIT


@FIXED
@given(payloads, st.sampled_from([(0x80, causes.EVERY_START), (0x40, causes.EVERY_END)]))
def test_a_start_or_end_bit_in_every_frame(payload: bytes, fault: tuple[int, str]) -> None:
    wrong = [part._replace(tail=part.tail | fault[0]) for part in sent(payload, first=100)]
    for part in wrong:
        proof = in_a_row([part], [*sent(payload), *wrong, *sent(payload, first=200)], expected())
        assert proof is not None
        assert proof == ((fault[1] if len(wrong) > 2 else proof.cause.what, proof.cause.detail), wrong)


@FIXED
@given(payloads)
def test_another_transfer_id_in_the_first_frame(payload: bytes) -> None:
    parts = sent(payload, first=100)
    parts[0] = parts[0]._replace(tail=parts[0].tail ^ 8)
    near = [*sent(payload, 3), *parts, *sent(payload, 5, 200)]
    for left in (parts[:1], parts[1:]):
        proof = in_a_row(left, near, expected())
        assert proof is not None
        assert proof.cause == (causes.OTHER_ID, " in frame 101")
    assume(any(parts[1].body))
    spoiled = parts[1]._replace(body=bytes(7))
    assert in_a_row(parts[:1], [parts[0], spoiled, *parts[2:]], expected()) is None


def test_a_transfer_in_one_frame_without_its_start_or_end_bit() -> None:
    part = Part(0, 0xC4, bytes(7))
    for bit, what in ((0x80, causes.START_BIT), (0x40, causes.END_BIT)):
        torn = [part._replace(tail=part.tail ^ bit)]
        for known in (KnownType([START], 7), KnownType([START], None, singles=frozenset({7}))):
            assert missing(torn, known) == (what, " (frame 1)")
        several = KnownType([START], None, lengths=frozenset({(3, 7)}), singles=frozenset({7}))
        assert "lost" in missing(torn, several).what, "others of this sender have several frames"


def test_what_a_sender_did_so_often_it_does_again() -> None:
    known, sender = budgets.KnownCauses(), int(budgets.senders_of(0, 10, 1034))

    def like(frames: int, received: int) -> str:
        senders, shapes = np.array([sender]), np.array([budgets.shapes_of(frames, received)])
        return budgets.WHATS[known.like_all(senders, shapes).item()]

    def note(frames: int, received: int, what: str, count: int) -> None:
        for _ in range(count):
            known.note((0, 10, 1034), frames, received, what)

    assert like(3, 16) == budgets.NOT_SEARCHED
    note(3, 16, causes.LOST, 20)
    assert like(3, 16) == causes.LOST
    assert like(4, 20) == causes.LOST, "of a shape that was never seen"
    note(4, 20, causes.SWAPPED, 3)
    assert like(4, 20) == causes.SWAPPED
    assert like(9, 60) == budgets.NOT_SEARCHED


RULES = ("TRF-002", "TRF-003", "TRF-005", "TRF-006", "TRF-009", "TRF-010", "TRF-012", "TRF-026")


def lines(*transfers: list[Frame]) -> list[tuple[str, str, str, int]]:
    found = whole(text(good(3), *transfers, good(30, 12)), RULES, (7, 100))
    return [(one.rule, one.severity, one.cause, one.count) for one in found]


def tailed(number: int, *masks: int) -> list[Frame]:
    """A report whose tail bytes have these bits turned."""
    frames = status(number)
    return [replace(f, data=f.data[:-1] + bytes((f.data[-1] ^ mask,))) for f, mask in zip(frames, masks, strict=True)]


@pytest.mark.parametrize(("part", "rule"), [(slice(1, None), "TRF-005"), (slice(0, -1), "TRF-006")])
def test_a_sender_that_never_sends_a_frame_is_one_finding(
    monkeypatch: pytest.MonkeyPatch, part: slice, rule: str
) -> None:
    monkeypatch.setattr(budgets, "MOST_SEARCHES", 3)
    torn = [status(number % 32)[part] for number in range(100)]
    slow = [replace(frame, t=k * 20_000_000) for k, frame in enumerate(frame for one in torn for frame in one)]
    said = whole("".join(log_line(frame) + "\n" for frame in slow), RULES, (7, 100))
    assert [(one.rule, one.severity) for one in said] == [(rule, "error")]
    assert "frame lost" in said[0].cause
    assert said[0].count >= 98


def test_a_wrong_id_inside_has_one_error() -> None:
    said = lines(*(status(number) for number in range(3, 11)), tailed(11, 0, 8, 0))
    assert [one for one in said if one[1] == "error"] == [("TRF-009", "error", "", 1)]


def test_a_wrong_id_of_the_first_frame_is_one_finding() -> None:
    said = lines(*(status(number) for number in range(3, 11)), tailed(11, 8, 0, 0))
    assert said == [("TRF-006", "error", causes.OTHER_ID, 1)]


def test_a_wrong_start_bit_in_the_middle_has_one_error() -> None:
    said = lines(*(status(number) for number in range(3, 11)), tailed(11, 0, 0x80, 0))
    assert [one for one in said if one[1] == "error"] == [("TRF-006", "error", causes.START_BIT, 1)]


def test_a_start_bit_in_every_frame_is_one_error() -> None:
    said = lines(*(tailed(number, 0, 0x80, 0x80) for number in range(3, 11)))
    assert [one for one in said if one[1] == "error"] == [("TRF-006", "error", causes.EVERY_START, 8)]


def test_an_end_bit_in_every_frame_is_one_error() -> None:
    said = lines(*(tailed(number, 0x40, 0x40, 0) for number in range(3, 11)))
    assert said == [("TRF-005", "error", causes.EVERY_END, 8)]


def test_an_end_bit_in_the_first_frame_loses_nothing() -> None:
    said = lines(*(status(number) for number in range(3, 11)), tailed(11, 0x40, 0, 0))
    assert said == [("TRF-005", "error", causes.END_BIT, 1)]


def test_a_short_frame_inside_is_the_cause_of_the_wrong_crc() -> None:
    first, second, third = status(11)
    short = replace(second, data=second.data[:2] + second.data[4:])
    said = lines(*(status(number) for number in range(3, 11)), [first, short, third])
    assert [one[:2] for one in said] == [("TRF-010", "note"), ("TRF-012", "error")]


def test_a_transfer_id_that_counts_frames_is_named() -> None:
    said = lines(*(tailed(0, 3 * k % 32, (3 * k + 1) % 32, (3 * k + 2) % 32) for k in range(10)))
    said_causes = {one[2] for one in said if one[0] in {"TRF-003", "TRF-006"}} - {"broken sequence"}
    assert said_causes == {causes.EVERY_ID}
    assert {one[0] for one in said if one[1] == "error"} <= {"TRF-009", "TRF-026"}
