"""What is remembered of frames and of gaps gives what a search through all of them would."""

from __future__ import annotations

import random
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pytest

from analyzer.rules.capture_gaps import GAP, CaptureGaps
from analyzer.rules.joint import repeats
from analyzer.rules.joint.lack_rows import UNASKED, LackRows
from analyzer.rules.joint.repeats import Repeats
from analyzer.tables import FRAMES
from dissectors.kit import SECOND, FrameTable

APART = 3 * SECOND  # so far no lack tells anything of another
FEW = 8


class Sent(NamedTuple):
    """A frame without its tail byte, and that."""

    bus: int
    identifier: int
    body: bytes
    tail: int


def sent(seed: int, count: int = 600) -> list[Sent]:
    """Frames of few identifiers and contents, so that many come again."""
    chance = random.Random(seed)
    bodies = [chance.randbytes(length) for length in (0, 0, 1, 6, 7, 7, 8, 9, 15, 16, 17, 63) for _ in range(5)]
    bodies += [body[:-1] + bytes([body[-1] ^ 1]) for body in bodies if body]
    return [
        Sent(chance.randrange(2), 0x1F040A0A + chance.randrange(2), chance.choice(bodies), chance.randrange(0xC0, 0xC4))
        for _ in range(count)
    ]


def table(frames: list[Sent], first: int = 0) -> FrameTable:
    given = {
        "bus": [one.bus for one in frames],
        "id": [one.identifier for one in frames],
        "data": [one.body + bytes([one.tail]) for one in frames],
    }
    rows = len(frames)
    columns = [pa.array(given.get(of.name, [0] * rows)).cast(of.type) for of in FRAMES]
    return FrameTable(pa.RecordBatch.from_arrays(columns, schema=FRAMES), first)


def came_once(frames: list[Sent], number: int) -> bool:
    """Whether a frame came once before, and among few with the same bytes, whose IDs are in a row."""
    like = [one.tail for one in frames[:number] if one[:3] == frames[number][:3]]
    ids = sorted({tail & 31 for tail in like})
    breaks = sum((after - one) % 32 != 1 for one, after in zip(ids, ids[1:] + ids[:1], strict=True))
    return like.count(frames[number].tail) == 1 and len(ids) == len(like) <= FEW and breaks <= 1


def lacks(numbers: list[int]) -> LackRows:
    """One of a session of its own at each frame."""
    at, each = np.array(numbers, np.int64), np.arange(len(numbers))
    none = LackRows.none()._asdict()
    rows = LackRows(**{name: np.zeros(len(at), column.dtype) for name, column in none.items()})
    unasked, left = np.full(len(at), UNASKED, np.uint8), np.full(len(at), -1)
    return rows._replace(session=at, node=at, number=at, behind=at, until=each * APART, left=left, seen=unasked)


@pytest.mark.sampled(4)
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("at_once", [1, 600])
def test_frames_that_came_once_before_are_found(seed: int, at_once: int) -> None:
    frames, known = sent(seed), Repeats()
    for first in range(0, len(frames), 70):
        known.feed(table(frames[first : first + 70], first))
    asked, every = lacks(list(range(len(frames)))), np.arange(len(frames))
    parts = [every[k : k + at_once] for k in range(0, len(frames), at_once)]
    for _ in range(2):  # the second time from what is kept
        found = {number for part in parts for number in part[known.among(asked, part)].tolist()}
        assert found == {number for number in range(len(frames)) if came_once(frames, number)} != set()


def test_large_batches_know_as_much_of_what_came_before_as_small_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    frames = [Sent(0, 0x1F040A0A, bytes([number]), 0xC0) for number in range(100)]
    monkeypatch.setattr(repeats, "_HELD", 100)
    for size in (10, 100, 150):
        known, again = Repeats(), [*frames, *frames]
        for first in range(0, len(again), size):
            known.feed(table(again[first : first + size], first))
            numbers = list(range(max(first, len(frames)), min(first + size, len(again))))
            assert known.among(lacks(numbers), np.arange(len(numbers))).all(), (size, first)


@pytest.mark.parametrize("seed", range(3))
def test_a_gap_is_found_wherever_it_is(seed: int) -> None:
    chance, gaps = random.Random(seed), CaptureGaps()
    t, times = 0, [0]
    for _ in range(400):
        t += chance.choice([1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 2, 2000, 9000]) * SECOND // 1000
        times.append(t)
    gaps.feed(np.array(times, np.int64), calm=False)
    for _ in range(500):
        since, until = sorted((chance.randrange(t), chance.randrange(t)))
        known = zip(gaps.begins, gaps.ends, gaps.hides, strict=True)
        by_hand = any(busy and begin < until and end > since for begin, end, busy in known)
        assert gaps.paused(since, until) == by_hand
    assert (gaps.hides & (gaps.ends - gaps.begins > GAP)).any()


def gaps_of(times: list[int]) -> list[tuple[int, int, bool]]:
    """Gaps by hand, looked at one time after the other."""
    found: list[tuple[int, int, bool]] = []
    for k in range(1, len(times)):
        apart = times[k] - times[k - 1]
        if apart < -GAP:
            found = [(times[k] - 1, times[k], False)]
        elif apart > GAP:
            hides = k >= 16 and apart > 8 * (times[k - 1] - times[k - 16])
            found.append((times[k - 1], times[k], hides))
    return found


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("size", [1, 7, 16, 1000])
def test_gaps_are_the_same_however_times_are_cut(seed: int, size: int) -> None:
    chance, gaps = random.Random(seed), CaptureGaps()
    steps = [1] * 60 + [GAP, GAP + 1, 9 * GAP, 40 * GAP, -5] + [-30 * GAP] * (seed % 3)
    times = [10**18]
    for _ in range(300):
        times.append(times[-1] + chance.choice(steps) * chance.choice([1, 1, 100]))
    for first in range(0, len(times), size):
        gaps.feed(np.array(times[first : first + size], np.int64), calm=False)
    known = [*zip(gaps.begins.tolist(), gaps.ends.tolist(), gaps.hides.tolist(), strict=True)]
    assert known == gaps_of(times) != []
    assert [gaps.resumed(t, 0) for t in gaps.ends.tolist()] == gaps.ends.tolist()
