"""Traffic over time: counts in steps that grow with the capture, as a loop over rows would have them."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analyzer.rules import course
from analyzer.rules.course import MOST_STEPS, Course
from dissectors.kit import NO_TIME, SECOND

START = 5 * SECOND


def view(rng: np.random.Generator, since: int, span: int) -> Any:
    """Return a batch with transfers and seconds at random times, some without one."""
    many = int(rng.integers(0, 60))
    t = np.sort(since + rng.integers(0, span, many))
    t[rng.random(many) < 0.1] = NO_TIME
    few = int(rng.integers(1, 5))
    seconds = SimpleNamespace(
        bus=rng.integers(0, 3, few), start=since + rng.integers(0, span, few),
        frames=rng.integers(1, 9, few), bits=rng.integers(1, 999, few),
    )  # fmt: skip
    transfers = SimpleNamespace(t=t, bus=rng.integers(0, 3, many, np.uint8), src=rng.integers(0, 256, many, np.uint8))
    return SimpleNamespace(frames=SimpleNamespace(t=np.array([NO_TIME, START])), seconds=seconds, transfers=transfers)


def counted(views: list[Any], step: int) -> dict[tuple[str, int], np.ndarray]:
    """Return what there is in each step, row by row."""
    found: dict[tuple[str, int], np.ndarray] = {}

    def add(name: str, key: int, t: int, much: int) -> None:
        row = found.setdefault((name, key), np.zeros(MOST_STEPS, int))
        row[max((t - START) // step, 0)] += much

    for one in views:
        for bus, start, frames, bits in zip(*vars(one.seconds).values(), strict=True):
            add("frames", bus, start, frames)
            add("bits", bus, start, bits)
        for t, bus, src in zip(*vars(one.transfers).values(), strict=True):
            if t != NO_TIME:
                add("transfers", int(bus) << 7 | int(src) & 0x7F, t, 1)
    return found


@pytest.mark.parametrize("span", [SECOND // 2, 700 * SECOND])
def test_it_counts_like_a_loop(span: int) -> None:
    rng = np.random.default_rng(span)
    views = [view(rng, START - SECOND + k * span, span) for k in range(12)]
    seen = Course()
    for one in views:
        seen.feed(one)
    expected = counted(views, seen.step)
    assert (seen.step == SECOND) == (span < SECOND)
    for (name, key), steps in expected.items():
        got = seen.transfers(key >> 7, key & 0x7F) if name == "transfers" else getattr(seen, name)(key)
        assert got == tuple(steps[: len(got)].tolist())
        assert not steps[len(got) :].any()
    assert len(seen.frames(0)) >= 1
    assert seen.frames(7) == seen.transfers(9, 1) == ()


def test_further_keys_are_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(course, "MOST_KEYS", 3)
    seen = course._Series()
    seen.add(np.array([9, 4]), np.array([0, 0]), 1)
    seen.add(np.array([8, 4, 2, 9]), np.array([1, 1, 1, 1]), np.array([5, 6, 7, 8]))
    assert {key: seen.of(key)[:2] for key in (2, 4, 8, 9)} == {2: (0, 7), 4: (1, 6), 8: (), 9: (1, 8)}


def test_a_capture_without_transfers_may_be_long() -> None:
    rng = np.random.default_rng(1)
    seen, frames = Course(), 0
    for k in range(12):
        one = view(rng, START + k * 700 * SECOND, 700 * SECOND)
        one.transfers.t[:] = NO_TIME
        seen.feed(one)
        frames += int(one.seconds.frames.sum())
    assert seen.step > SECOND
    assert sum(sum(seen.frames(bus)) for bus in range(3)) == frames
    assert seen.transfers(1, 1) == ()
