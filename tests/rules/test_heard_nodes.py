"""When a node was not heard: the latest gaps, the longest one between two times, and the lines before it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from analyzer.rules.bus.heard import Gap, HeardNodes
from analyzer.tables import EXTENDED, FRAMES
from dissectors.kit import FrameTable

if TYPE_CHECKING:
    from collections.abc import Sequence

NODE = 11
OTHER = 12


class Batch:
    """Frames of nodes at some times, and their lines while they are the newest: else they are gone."""

    def __init__(self, first: int, heard: Sequence[tuple[int, int]]) -> None:
        rows, columns = len(heard), {name: [0] * len(heard) for name in ("bus", "verdict", "anomaly")}
        columns |= {"t": [t for t, _ in heard], "id": [0x1803E800 | node for _, node in heard]}
        columns |= {"flags": [EXTENDED] * rows, "line": [1] * rows}
        table = pa.RecordBatch.from_pydict(columns | {"data": [b"\xc0"] * rows}, schema=FRAMES)
        self.frames = FrameTable(table, first)

    def each_line(self, numbers: Any) -> Any:
        """Return the lines of frames of this batch and the one before."""
        return np.array([f"line {one}" if one >= self.frames.first - 2 else "" for one in numbers.tolist()], object)


def heard(*t: int, least: int = 2) -> HeardNodes:
    nodes = HeardNodes(least)
    nodes.feed(Batch(0, [(one, NODE) for one in t]).frames)
    return nodes


def longest(nodes: HeardNodes, start: Any, stop: Any) -> list[tuple[int, int]]:
    found = nodes.longest(np.full(len(start), NODE), start, stop)
    return list(zip(*(column.tolist() for column in found), strict=True))


def test_the_longest_gap_between_two_times_is_found() -> None:
    nodes = heard(10, 20, 22, 30, 70, 71, 80, 100)
    start, stop = np.array([0, 0, 71, 21, 12]), np.array([100, 65, 100, 30, 19])
    assert longest(nodes, start, stop) == [(30, 70), (10, 20), (80, 100), (22, 30), (19, 19)]
    assert longest(HeardNodes(2), start, stop) == [(one, one) for one in stop.tolist()]


def test_many_questions_at_once_have_the_same_answers() -> None:
    chance = np.random.default_rng(1)
    nodes = heard(*np.cumsum(chance.integers(1, 20, 200)).tolist(), least=4)
    start = chance.integers(0, 2000, 1000)
    stop = start + chance.integers(0, 400, 1000)
    for low, high, found in zip(start.tolist(), stop.tolist(), longest(nodes, start, stop), strict=True):
        gaps = nodes.gaps(0, NODE, low, high)
        inside = max(gaps, key=lambda gap: gap.stop - gap.start, default=Gap(high, high, -1))
        assert found == (inside.start, inside.stop)


def test_which_times_lie_in_a_gap() -> None:
    nodes = heard(0, 5, 6, 10)
    t = np.array([-1, 0, 4, 5, 6, 9, 10, 11])
    assert nodes.silent(np.full(8, NODE), t, 12).tolist() == [False, True, True, False, True, True, False, False]
    assert nodes.silent(np.full(8, NODE), t, 13).tolist()[-2:] == [True, True]
    assert not nodes.silent(np.full(8, OTHER), t, 13).any()


def test_what_lasts_to_the_end_of_a_bus_is_a_gap() -> None:
    nodes = heard(0, 1)
    nodes.finish({1: 100})
    assert nodes.gaps(0, NODE, 0, 100) == []
    nodes.finish({0: 9})
    assert nodes.gaps(0, NODE, 0, 100) == [Gap(1, 9, 1)]


def test_lines_are_kept_of_the_frames_before_silences() -> None:
    nodes, number = HeardNodes(2), 0
    for t in range(0, 30, 3):
        batch = Batch(number, [(t, OTHER), *([(t, NODE)] if t in (0, 27) else [])])
        nodes.feed(batch.frames)
        nodes.keep_lines(batch)  # type: ignore[arg-type]
        number += len(batch.frames)
    assert nodes.gaps(0, NODE, 0, 30) == [Gap(0, 27, 1, ("line 1",))]
    assert {gap.lines for gap in nodes.gaps(0, OTHER, 0, 30)} == {()}  # was heard in every batch


def test_lines_of_nodes_that_go_on_in_time_are_not_kept() -> None:
    nodes = HeardNodes(25)
    for k in range(600):
        batch = Batch(k, [(10 * k + 100 * (k > 9), NODE if k % 2 else OTHER)])
        nodes.feed(batch.frames)
        nodes.keep_lines(batch)  # type: ignore[arg-type]
    assert nodes.gaps(0, NODE, 0, 9999) == [Gap(90, 210, 9, ("line 9",))]
    assert nodes.gaps(0, OTHER, 0, 9999) == [Gap(80, 200, 8, ("line 8",))]
    assert [len(lines) for lines in nodes._lines.values()] == [2, 2]


def test_the_oldest_gaps_are_forgotten_with_their_lines() -> None:
    nodes = HeardNodes(2)
    for k in range(1200):
        batch = Batch(k, [(10 * k, NODE if k % 2 else OTHER)])
        nodes.feed(batch.frames)
        nodes.keep_lines(batch)  # type: ignore[arg-type]
    kept = nodes.gaps(0, NODE, 0, 20_000)
    assert (len(kept), kept[-1]) == (256, Gap(11970, 11990, 1197, ("line 1197",)))
    assert {len(gap.lines) for gap in kept} == {1}
    assert all(len(lines) <= 512 for lines in nodes._lines.values())
