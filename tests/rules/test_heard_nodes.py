"""When a node was not heard: the latest gaps, the longest one between two times, and the lines before it."""

from __future__ import annotations

import numpy as np

from analyzer.rules.bus.heard import Gap, HeardNode


def heard(*gaps: tuple[int, int]) -> HeardNode:
    """Return a node with gaps, each behind the frame with its place as number."""
    node = HeardNode()
    for number, (begin, end) in enumerate(gaps):
        node.pause(Gap(begin, end, number))
    return node


def test_the_longest_gap_between_two_times_is_found() -> None:
    node = heard((10, 20), (30, 70), (80, 100))
    start, stop = np.array([0, 0, 71, 21, 12]), np.array([100, 65, 100, 30, 19])
    begins, ends = node.longest(start, stop)
    assert begins.tolist() == [30, 10, 80, 30, 19]
    assert ends.tolist() == [70, 20, 100, 30, 19]
    none = HeardNode().longest(start, stop)
    assert none[0].tolist() == none[1].tolist() == stop.tolist()


def test_many_questions_at_once_have_the_same_answers() -> None:
    chance = np.random.default_rng(1)
    node = heard(*((int(t), int(t) + 5 + int(t) % 7) for t in chance.integers(0, 5000, 200)))
    start = chance.integers(0, 5000, 1000)
    stop = start + chance.integers(0, 400, 1000)
    begins, ends = node.longest(start, stop)
    for k, (low, high) in enumerate(zip(start.tolist(), stop.tolist(), strict=True)):
        inside = max(node.between(low, high), key=lambda gap: gap.stop - gap.start, default=Gap(high, high, -1))
        assert (begins[k], ends[k]) == (inside.start, inside.stop)


def test_the_oldest_gaps_are_forgotten_with_their_lines() -> None:
    node = HeardNode()
    node.pause(Gap(0, 1, 0, ("first",)))
    assert node.between(0, 1) == [Gap(0, 1, 0, ("first",))]
    for k in range(1, 300):
        node.pause(Gap(10 * k, 10 * k + 5, k, ("line",) if k == 299 else ()))
    kept = node.between(0, 10_000)
    assert (len(kept), kept[0].start, kept[-1].lines) == (256, 440, ("line",))
    node.pause(Gap(0, 1, 0))
    assert node.between(0, 1) == [Gap(0, 1, 0)]
    for k in range(1000):
        node.pause(Gap(k, k + 1, k))
        assert len(node.gaps[0]) == 256
