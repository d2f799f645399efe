"""The clock of a recording: holes are what they are found to be frame by frame, however frames come in pieces."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from analyzer.flight import clock
from analyzer.flight.clock import RecordedClock
from analyzer.flight.thresholds import lasting, threshold
from dissectors.times import MILLISECOND, SECOND

if TYPE_CHECKING:
    import pytest

HOLE, SLOW = lasting("hole"), lasting("slow_hole")
STEPS = st.lists(
    st.sampled_from([MILLISECOND, HOLE + 1, 2 * HOLE, SLOW - 1, SLOW + 1, 9 * SECOND, -lasting("clock_back") - 1]),
    min_size=1, max_size=60,
)  # fmt: skip


def _one_by_one(times: list[int], before: int, first: int) -> tuple[list[int], int]:
    """Return the frames before which holes are, and by how much of the time nothing was recorded."""
    found, shift = [], 0
    for count, (since, t) in enumerate(zip([times[0], *times], times, strict=False)):
        step, mean = t - since, (since + shift - first) / max(before + count, 1)
        far = threshold("hole_factor") * mean
        usual = max(HOLE, far) if far < SLOW else max(SLOW, far / 10)
        if before + count < threshold("hole_frames"):
            usual = SLOW
        if step < -lasting("clock_back") or (step > HOLE and step > usual):
            found.append(count)
            shift -= step
    return found, -shift


@given(STEPS, st.sampled_from([0, 2000]), st.data())
def test_holes_are_those_found_frame_by_frame(steps: list[int], before: int, data: st.DataObject) -> None:
    times = np.cumsum([10**15, *steps])
    cut = data.draw(st.integers(0, len(times)))
    made = RecordedClock()
    made._count = before
    for piece in (slice(0, cut), slice(cut, None)):
        if len(times[piece]):
            made._note(times[piece], None, cut if piece.stop is None else 0)
    holes, missing = _one_by_one(times.tolist(), before, int(times[0]))
    assert [hole.frame for hole in made.holes] == holes
    assert made.ran == int(times[-1]) - missing


def test_of_too_many_holes_the_first_are_kept_and_the_last_shifts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clock, "MOST_HOLES", 2)
    made = RecordedClock()
    for k in range(6):
        made._note(np.array([20 * k * SECOND]), None, k)
    assert [hole.frame for hole in made.holes] == [1, 2]
    assert made.ran == 0
    assert made.shifted(np.array([80, 100]) * SECOND, np.array([4, 5])).ran.tolist() == [0, 0]
