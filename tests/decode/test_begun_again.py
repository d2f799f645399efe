"""Transfers that were cut, when their transfer ID comes again with the same values or after others."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from kit.encode import transfer
from kit.judged import whole
from kit.traffic import MS, at, lines

if TYPE_CHECKING:
    from kit.encode import Frame

RULES = ("TRF",)


def throttles(count: int) -> list[list[Frame]]:
    """Eight channels at rest, three frames every 2.5 ms: every 32nd transfer has the bytes of the first."""
    sent = (transfer("RawCommand", {"cmd": [0] * 8}, 10, k % 32).frames() for k in range(count))
    return [[at(int(k * 2.5 * MS) + j * 200_000, frame) for j, frame in enumerate(one)] for k, one in enumerate(sent)]


def said(text: bytes) -> list[tuple[str, str, int]]:
    return [(one.rule, one.severity, one.count) for one in whole(text, RULES)]


@pytest.mark.slow
def test_a_cut_transfer_is_not_continued_a_round_later() -> None:
    for kept in (1, 2):
        sent = throttles(200)
        sent[50] = sent[50][:kept]
        assert said(lines(*sent)) == [("TRF-006", "error", 1)]


@pytest.mark.slow
def test_many_cut_transfers_are_each_told() -> None:
    sent = throttles(400)
    for k in range(40, 360, 7):
        sent[k] = sent[k][:1]
    assert said(lines(*sent)) == [("TRF-006", "error", 46)]


@pytest.mark.slow
def test_a_first_frame_that_comes_twice_is_a_copy() -> None:
    sent = throttles(100)
    sent[50].insert(1, at(int(125.1 * MS), sent[50][0]))
    assert said(lines(*sent)) == [("TRF-004", "warning", 1)]


@pytest.mark.slow
def test_transfers_after_a_cut_one_are_counted_from_each_other() -> None:
    # The last frame of transfer 18 is lost, and of the next round transfers 11 to 13.
    sent = throttles(150)
    sent[50] = sent[50][:2]
    found = whole(lines(*sent[:75], *sent[78:]), RULES)
    missing = [(one.rule, one.count, one.text) for one in found if one.rule != "TRF-006"]
    assert missing == [("TRF-016", 1, "expected 11, got 14: 3 missing")]
    assert [one.count for one in found if one.rule == "TRF-006"] == [1]


@pytest.mark.slow
def test_a_round_that_is_missing_after_a_cut_transfer_is_told() -> None:
    for kept in (1, 2):
        sent = throttles(150)
        sent[50] = sent[50][:kept]
        found = whole(lines(*sent[:51], *sent[82:]), RULES)
        assert [(one.rule, one.count) for one in found] == [("TRF-006", 1), ("TRF-016", 1)]
        assert "31 missing" in found[1].text
