"""Valid traffic with one damage: the cause that is named must be that damage, or say honestly what it may be."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from kit import encode
from kit.encode import Frame, Transfer, log_line
from kit.judged import whole
from kit.strategies import examples

from analyzer.rules.diagnosis import causes, checksums

if TYPE_CHECKING:
    from kit.judged import Said

RULES = ("TRF-003", "TRF-004", "TRF-005", "TRF-006", "TRF-007", "TRF-009", "TRF-010", "TRF-012", "TRF-026")
FOLDED = "broken sequence"
SIZES = {1034: 14, 1039: 32, 1332: 75}  # bytes: a fixed length, one of the sender's choice, a long one
TYPES = {one.type_id: one.signature for one in encode.TYPES.values() if one.kind == "message"}
MS = 1_000_000
LATE = 5000 * MS  # by then nothing is excused as under way when the capture began
PERIOD = 40 * MS
LAWS = examples(25, derandomize=True)
kinds = st.sampled_from(sorted(SIZES))


def sent(type_id: int, number: int) -> list[Frame]:
    """One transfer of a sender that never sends the same twice."""
    size = SIZES[type_id]
    body = bytes((number * 37 + k * k * 11) % 255 + 1 for k in range(size))
    return Transfer("message", type_id, 10, body, TYPES[type_id], number % 32).frames(
        LATE * bool(number) + number * PERIOD
    )


def before(type_id: int) -> list[Frame]:
    return [frame for number in range(6) for frame in sent(type_id, number)]


def after(type_id: int) -> list[Frame]:
    return [frame for number in range(7, 40) for frame in sent(type_id, number)]


def judged(type_id: int, came: list[Frame]) -> list[Said]:
    """What is said if these frames come in place of the transfer 6, in whatever batches."""
    first = sent(type_id, 6)[0].t
    timed = [replace(frame, t=first + k * MS // 4) for k, frame in enumerate(came)]
    text = "".join(log_line(frame) + "\n" for frame in (*before(type_id), *timed, *after(type_id)))
    return whole(text, RULES, (7, 100))


def causes_of(said: list[Said]) -> set[str]:
    return {one.cause for one in said} - {FOLDED, ""}


def retailed(frame: Frame, bits: int) -> Frame:
    return replace(frame, data=frame.data[:-1] + bytes([frame.data[-1] ^ bits]))


@pytest.mark.parametrize("type_id", sorted(SIZES))
def test_nothing_is_said_of_whole_transfers(type_id: int) -> None:
    assert judged(type_id, sent(type_id, 6)) == []


@pytest.mark.slow
@LAWS
@given(kinds, st.data())
def test_frames_that_are_lost_are_one_occurrence(type_id: int, data: st.DataObject) -> None:
    frames = sent(type_id, 6)
    low = data.draw(st.integers(0, len(frames) - 1))
    gone = data.draw(st.integers(1, len(frames) - max(low, 1) if low else len(frames) - 1))
    said = [one for one in judged(type_id, frames[:low] + frames[low + gone :]) if one.cause != FOLDED]
    assert [one.count for one in said] == [1]
    (one,) = said
    if low == 0:
        assert (one.rule, one.cause) == ("TRF-005", causes.FIRST if gone == 1 else causes.FIRSTS)
    elif low + gone == len(frames):
        assert (one.rule, one.cause) == ("TRF-006", causes.LAST if gone == 1 else causes.LASTS)
    else:
        assert one.rule == ("TRF-003" if gone % 2 else "TRF-010")
        assert one.cause == (causes.LOST if gone == 1 else causes.LOST_SEVERAL)
    if gone > 1 or low > 0:
        assert str(len(frames)) in one.text


@pytest.mark.slow
@LAWS
@given(kinds, st.data())
def test_frames_that_are_swapped_are_one_occurrence(type_id: int, data: st.DataObject) -> None:
    frames = sent(type_id, 6)
    low = data.draw(st.integers(0, len(frames) - 2))
    high = data.draw(st.integers(low + 1, min(low + 2, len(frames) - 1)))
    frames[low], frames[high] = frames[high], frames[low]
    said = [one for one in judged(type_id, frames) if one.cause != FOLDED]
    assert [(one.cause, one.count) for one in said] == [(causes.SWAPPED, 1)]


@pytest.mark.slow
@LAWS
@given(kinds, st.data())
def test_a_frame_that_comes_again_later(type_id: int, data: st.DataObject) -> None:
    frames = sent(type_id, 6)
    at = data.draw(st.integers(0, len(frames) - 1))
    later = data.draw(st.integers(at + 1, len(frames)))
    said = judged(type_id, [*frames[:later], frames[at], *frames[later:]])
    if later == at + 1:
        assert [(one.rule, one.count) for one in said] == [("TRF-004", 1)]
    elif later < len(frames):
        assert causes_of(said) == {causes.REPEATED}
        assert sum(one.count for one in said if one.cause == causes.REPEATED) == 1


@pytest.mark.slow
@LAWS
@given(kinds, st.data())
def test_one_turned_bit_of_the_payload_is_placed(type_id: int, data: st.DataObject) -> None:
    frames = sent(type_id, 6)
    at = data.draw(st.integers(0, len(frames) - 1))
    byte = data.draw(st.integers(0, len(frames[at].data) - 2))
    turned = bytearray(frames[at].data)
    turned[byte] ^= 1 << data.draw(st.integers(0, 7))
    frames[at] = replace(frames[at], data=bytes(turned))
    (one,) = judged(type_id, frames)
    place = len(before(type_id)) + at + 1
    assert (one.rule, one.cause) == ("TRF-010", checksums.CORRUPTED)
    assert one.text.endswith(f"(one bit turned in byte {byte + 1} of frame {place})")


@pytest.mark.slow
@LAWS
@given(kinds, st.data())
def test_a_turned_bit_of_a_tail_byte_is_named(type_id: int, data: st.DataObject) -> None:
    frames = sent(type_id, 6)
    at = data.draw(st.integers(1, len(frames) - 1))
    bit, cause = data.draw(st.sampled_from([
        (0x20, causes.WRONG_BIT), (0x40, causes.END_BIT), (1, causes.OTHER_ID),
    ]))  # fmt: skip
    frames[at] = retailed(frames[at], bit)
    said = judged(type_id, frames)
    assert causes_of(said) == {cause}
    assert "TRF-012" not in {one.rule for one in said}
    if bit == 1:
        assert [one.text.rpartition(": ")[2] for one in said if one.rule == "TRF-009"] == ["it belongs to that one"]


@LAWS
@given(kinds)
def test_toggles_that_stand_still_make_no_copies(type_id: int) -> None:
    frames = [replace(frame, data=frame.data[:-1] + bytes([frame.data[-1] & ~0x20])) for frame in sent(type_id, 6)]
    said = judged(type_id, frames)
    assert {one.rule for one in said} == {"TRF-003", "TRF-006"}
    assert causes_of(said) == {causes.WRONG_BIT}


def test_equal_frames_whose_toggles_stand_still_are_no_copies() -> None:
    body = bytes(7 * 10)
    frames = Transfer("message", 1039, 10, body, TYPES[1039], 6).frames()
    still = [replace(frame, data=frame.data[:-1] + bytes([frame.data[-1] & ~0x20])) for frame in frames]
    said = judged(1039, still)
    assert {(one.rule, one.cause) for one in said} == {("TRF-003", causes.WRONG_BIT), ("TRF-006", FOLDED)}


@LAWS
@given(kinds, st.binary(min_size=7, max_size=7), st.integers(0, 31), st.sampled_from([0, 0x20, 0x40, 0x60, 0xC0]))
def test_a_foreign_frame_inside_leaves_the_rest_right(type_id: int, body: bytes, number: int, bits: int) -> None:
    assume(number not in {5, 6, 7})
    frames = sent(type_id, 6)
    frames.insert(2, replace(frames[0], data=body + bytes([bits | number])))
    said = judged(type_id, frames)
    assert {one.rule for one in said} <= {"TRF-009", "TRF-026"}
    place = len(before(type_id)) + 3
    assert any(f"foreign frame {place} inside, the CRC is right without" in one.text for one in said)


@pytest.mark.slow
@LAWS
@given(kinds, st.integers(0, 0xFFFF))
def test_a_start_value_that_all_crcs_have_in_common(type_id: int, start: int) -> None:
    assume(start != encode.signature_crc(TYPES[type_id]))
    frames: list[Frame] = []
    for number in range(6, 12):
        whole_one = sent(type_id, number)
        payload = b"".join(frame.data[:-1] for frame in whole_one)[2:]
        crc = encode.crc16(payload, start).to_bytes(2, "little")
        frames += [replace(whole_one[0], data=crc + whole_one[0].data[2:]), *whole_one[1:]]
    said = judged(type_id, frames)
    (one,) = [one for one in said if one.rule == "TRF-010"]
    assert one.count == 6
    assert "signature" in one.cause or "one bit turned" in one.text


@pytest.mark.parametrize("left", [1, 2])
@pytest.mark.parametrize("gone", [1, 2])
def test_an_end_and_the_next_start_lost_are_no_foreign_ids(left: int, gone: int) -> None:
    """Frames of one transfer that lost its end are followed by those of one that lost its start."""
    said = judged(1034, [*sent(1034, 6)[:left], *sent(1034, 20)[gone:]])
    assert [(one.rule, one.count) for one in said] == [("TRF-006", 1), ("TRF-005", 1)]
    assert all("lost" in one.cause for one in said)
