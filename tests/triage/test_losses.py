"""Counts of nodes by second: sums over a time, whichever way is shorter, and their bound."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.flight import senders
from analyzer.flight.senders import CountsBySecond

if TYPE_CHECKING:
    import pytest

ONE, OTHER = (0, 11), (1, 11)


def test_sums_over_a_short_and_a_long_time() -> None:
    counts = CountsBySecond()
    told = [counts.add(ONE, 3, 2), counts.add(OTHER, 3, 1), counts.add(ONE, 3, 5), counts.add(ONE, -1, 4)]
    assert told == [True, True, False, True]
    assert list(counts.between(3, 3)) == [{ONE: 7, OTHER: 1}]
    assert list(counts.between(4, 2)) == []
    assert sorted(sum(of.values()) for of in counts.between(-(10**12), 10**12)) == [4, 8]


def test_what_is_beyond_the_bound_is_not_told_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(senders, "MOST_ENTRIES", 1)
    counts = CountsBySecond()
    assert [counts.add(ONE, 1, 1), counts.add(OTHER, 1, 1), counts.add(ONE, 2, 1), counts.add(ONE, 1, 1)] == [
        True, False, False, False,
    ]  # fmt: skip
    assert counts.seconds == {1: {ONE: 2}}
