"""Counts of nodes by second: sums over a time, the order in which they come, and their bound."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.flight import senders
from analyzer.flight.senders import CountsBySecond

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pytest

ONE, OTHER = 11, 1 << 8 | 11


def add(counts: CountsBySecond, some: Mapping[tuple[int, int], int]) -> list[tuple[int, int]]:
    """Add counts by second and node, the last of which came first; return the new ones."""
    wanted = sorted(some)
    came = [len(some) - list(some).index(key) for key in wanted]
    keys = np.array([second << 16 | node for second, node in wanted], np.int64)
    return [wanted[k] for k in counts.add(keys, np.array([some[key] for key in wanted]), np.array(came)).tolist()]


def told(counts: CountsBySecond, first: int, last: int) -> list[tuple[int, int]]:
    """Return the nodes and their counts in some seconds."""
    nodes, found = counts.between(first, last)
    return list(zip(nodes.tolist(), found.tolist(), strict=True))


def test_sums_over_a_short_and_a_long_time() -> None:
    counts = CountsBySecond()
    assert add(counts, {(3, ONE): 2, (3, OTHER): 1}) == [(3, ONE), (3, OTHER)]
    assert add(counts, {(-1, ONE): 4, (3, ONE): 5}) == [(-1, ONE)]
    assert told(counts, 3, 3) == [(ONE, 7), (OTHER, 1)]
    assert told(counts, 4, 2) == told(counts, 0, 2) == []
    assert told(counts, -(10**9), 10**9) == [(ONE, 4), (ONE, 7), (OTHER, 1)]


def test_what_comes_late_stands_where_it_belongs() -> None:
    counts, wanted = CountsBySecond(), {}
    chance = np.random.default_rng(1)
    for _ in range(50):
        some = {(int(a), int(b)): int(a * 3 + b) for a, b in chance.integers(0, 30, (8, 2))}
        add(counts, some)
        wanted |= {key: wanted.get(key, 0) + count for key, count in some.items()}
    assert told(counts, 0, 30) == [(node, wanted[second, node]) for second, node in sorted(wanted)]


def test_a_node_is_alone_in_its_second_until_another_one_comes() -> None:
    counts = CountsBySecond()
    add(counts, {(1, ONE): 1, (2, ONE): 1, (2, OTHER): 1})
    assert counts.alone(np.array([1 << 16 | ONE, 2 << 16 | ONE])).tolist() == [True, False]
    add(counts, {(1, OTHER): 1})
    assert counts.alone(np.array([1 << 16 | ONE])).tolist() == [False]


def test_what_is_beyond_the_bound_is_not_told_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(senders, "MOST_ENTRIES", 2)
    counts = CountsBySecond()
    assert add(counts, {(1, OTHER): 1, (2, ONE): 1, (1, ONE): 1}) == [(1, ONE), (2, ONE)], "those that came first"
    assert add(counts, {(3, ONE): 1, (1, ONE): 1}) == []
    assert told(counts, 0, 9) == [(ONE, 2), (ONE, 1)]
