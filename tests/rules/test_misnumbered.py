"""Transfers whose first frame has a wrong ID: they have come, so their IDs are not missing."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from kit.encode import transfer
from kit.judged import whole
from kit.traffic import alive, log

from analyzer.rules.transfers.id_steps import WITHOUT_START

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
