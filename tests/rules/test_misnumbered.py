"""Transfers whose first frame has a wrong ID: they have come, so their IDs are not missing."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from kit.encode import transfer
from kit.judged import whole
from kit.traffic import alive, log

from analyzer.rules.counters.id_steps import WITHOUT_START

if TYPE_CHECKING:
    from collections.abc import Sequence

OTHERS = [(250 + 500 * k, alive(5, 98, k % 32, vendor_specific_status_code=k)) for k in range(20)]


@pytest.mark.sampled(5)
@pytest.mark.parametrize("wrong", [0, 5, 19, 20, 21, 22, 23, 31])
@pytest.mark.parametrize("size", [4, 25])
def test_a_wrong_id_in_a_first_frame_is_no_loss(wrong: int, size: int) -> None:
    """It is told as what it is (TRF-006); what is lost beside it still counts."""

    def seen_of(gone: Sequence[int] = (), cut: Sequence[int] = ()) -> list[str]:
        text = log(*OTHERS)
        for k in range(15, 27):
            fields = {"data_sequence": k, "data": [k, *range(1, size)]}
            frames = log((3000 + k * 100, transfer("PUSHCAN", fields, 11, k))).splitlines(keepends=True)
            if k == 21:
                frames[0] = f"{frames[0][:-3]}{0x80 | wrong:02X}\n"
            text += "".join(() if k in gone else frames[1:] if k in cut else frames)
        return [one.text for one in whole(text, ("TRF-016", "TRF-018", "TRF-019")) if one.node == 11]

    assert seen_of() == []
    assert seen_of(gone=(24,)) == ["expected 24, got 25: 1 missing"]
    if wrong not in {20, 22}:  # which seem to be the one that is lost
        assert seen_of(gone=(20,)) == ["expected 20, got 21: 1 missing"]
        assert seen_of(gone=(22,)) == ["expected 22, got 23: 1 missing"]
        assert seen_of(gone=(21,)) == ["expected 21, got 22: 1 missing"]


def test_the_rest_of_a_transfer_behind_the_start_of_another_one_is_no_wrong_id() -> None:
    """By the CRC they do not belong together."""
    text = log(*OTHERS)
    for k in range(1, 9):
        fields = {"data_sequence": k, "data": [1, 2, 3, k]}
        frames = log((3000 + k * 100, transfer("PUSHCAN", fields, 11, k))).splitlines(keepends=True)
        text += "".join(frames[:1] if k == 4 else frames[1:] if k == 5 else frames)
    (one,) = whole(text, ("TRF-016",))
    assert (one.text, one.cause) == ("expected 5, got 6: 1 missing", WITHOUT_START)


def pairs(*numbered: tuple[int, int]) -> str:
    """A capture of transfers of two frames, from frame 7 on; given are the transfer IDs in both."""
    text = log(*OTHERS[:6])
    for k, ids in enumerate(numbered):
        sent = transfer("PUSHCAN", {"data_sequence": k, "data": [k, 1, 2, 3]}, 11, 0)
        frames = log((3000 + k * 100, sent)).splitlines(keepends=True)
        text += "".join(f"{one[:-3]}{int(one[-3:-1], 16) | n:02X}\n" for one, n in zip(frames, ids, strict=True))
    return text


def same(*ids: int) -> list[tuple[int, int]]:
    return [(one, one) for one in ids]


@pytest.mark.parametrize(
    ("sent", "rule", "frames", "named"),
    [
        ([*same(3, 4), (19, 5), *same(6, 7, 8)], "TRF-006", 11, "11"),
        ([*same(3, 4), (6, 5), *same(6, 7, 8)], "TRF-006", 11, "11"),
        ([*same(3, 4), (4, 5), *same(7, 8, 9)], "TRF-006", 11, "11"),  # the one behind it is lost
        ([*same(2, 3), (19, 5), *same(6, 7, 8)], "TRF-006", 11, "11"),  # the one before it is lost
        ([(19, 5), *same(6, 7, 8)], "TRF-006", 7, "7"),
        ([*same(3, 4), (4, 5), *same(6, 7, 8)], "TRF-006", 11, "11"),
        ([*same(2, 3), (4, 5), *same(6, 7, 8)], "TRF-006", 11, "11 or 12"),
        ([*same(2, 3), (19, 5), *same(7, 8, 9)], "TRF-006", 11, "11 or 12"),
        ([*same(3, 4), (5, 19), *same(6, 7, 8)], "TRF-009", 12, ""),
        ([*same(3, 4), (5, 4), *same(6, 7, 8)], "TRF-009", 12, ""),
        ([*same(3, 4), (5, 6), *same(6, 7, 8)], "TRF-009", 12, ""),
        ([(5, 19), *same(6, 7, 8)], "TRF-009", 8, ""),
    ],
)
def test_which_of_two_frames_has_the_wrong_id(sent: list[tuple[int, int]], rule: str, frames: int, named: str) -> None:
    """The IDs of the transfers before and behind them tell; else nobody knows."""
    found = whole(pairs(*sent), ("TRF-005", "TRF-006", "TRF-009"))
    (one,) = [one for one in found if one.severity == "error"]
    assert (one.rule, one.frames) == (rule, (frames,))
    end = f"never complete: wrong transfer ID in frame {named}" if named else ": it belongs to that one"
    assert one.text.endswith(end)


def test_two_transfers_whose_first_frames_have_the_same_wrong_id() -> None:
    found = whole(pairs(*same(3, 4), (19, 5), (19, 6), *same(7, 8)), ("TRF-005", "TRF-006", "TRF-009"))
    assert {(one.rule, one.count) for one in found} == {("TRF-006", 2)}


@pytest.mark.parametrize("wrong", [0, 9, 31])
def test_frames_around_one_with_a_wrong_id_are_no_copies(wrong: int) -> None:
    """Those before and behind it are alike, byte for byte, in a transfer that is mostly zeros."""
    text = log(*OTHERS[:6])
    for k in range(3, 9):
        sent = transfer("PUSHCAN", {"data_sequence": k, "data": [k, *[0] * 60]}, 11, k)
        frames = log((3000 + k * 100, sent)).splitlines(keepends=True)
        if k == 5:
            frames[4] = f"{frames[4][:-3]}{int(frames[4][-3:-1], 16) & 0xE0 | wrong:02X}\n"
        text += "".join(frames)
    found = whole(text, ("TRF-003", "TRF-004", "TRF-006", "TRF-009", "TRF-010"))
    assert [one.rule for one in found if one.severity != "note"] == ["TRF-009"]


def test_a_copy_beside_a_wrong_id_is_one() -> None:
    text = log(*OTHERS[:6])
    for k in range(3, 9):
        sent = transfer("PUSHCAN", {"data_sequence": k, "data": [k, *range(60)]}, 11, k)
        frames = log((3000 + k * 100, sent)).splitlines(keepends=True)
        if k == 5:
            frames[4] = f"{frames[4][:-3]}{int(frames[4][-3:-1], 16) & 0xE0 | 9:02X}\n"
            frames.insert(3, frames[2])
        text += "".join(frames)
    found = whole(text, ("TRF-004", "TRF-009"))
    assert sorted(one.rule for one in found if one.severity != "note") == ["TRF-004", "TRF-009"]
