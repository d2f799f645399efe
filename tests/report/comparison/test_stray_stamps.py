"""Time stamps far off those around them: one, two in a row, three; anywhere in a capture and in its batches."""

from __future__ import annotations

import pytest

from analyzer.decode.engine import Engine
from analyzer.report.comparison.clock import BelievedTimes

START, STEP, COUNT = 1_700_000_000, 0.01, 40
ROWS = (0, 1, 2, 17, 19, 20, 37, 38)


def believed(wrong: dict[int, float], cut: int) -> BelievedTimes:
    """Return what is believed of a capture whose stamps are steady but for some, in two batches."""
    lines = [
        f"({wrong.get(k, START + k * STEP):.6f}) can0 1F040A0B#{k:02X}00000000000{0xC0 | k % 32:03X}\n".encode()
        for k in range(COUNT)
    ]
    engine, clock = Engine(), BelievedTimes()
    for part in (b"".join(lines[:cut]), b"".join(lines[cut:])):
        for _ in engine.feed(part):
            pass
        clock.feed(engine.flush())
    return clock


@pytest.mark.parametrize("off", [-3600.0, 3600.0])
@pytest.mark.parametrize("many", [1, 2])
def test_one_or_two_in_a_row_are_not_believed(many: int, off: float) -> None:
    for row in ROWS:
        clock = believed({row + k: START + off + k * STEP for k in range(many)}, 20)
        times = [START + k * STEP for k in range(COUNT) if not row <= k < row + many]
        assert clock.stray == many, row
        assert (clock.start, clock.end) == (pytest.approx(min(times) * 1e9), pytest.approx(max(times) * 1e9)), row
        told = clock.believed(int((START + off) * 1e9))
        assert told == pytest.approx((START + row * STEP) * 1e9, abs=4 * STEP * 1e9), row


@pytest.mark.parametrize("row", [3, 15, 36])
def test_a_clock_that_is_set_is_believed(row: int) -> None:
    clock = believed({k: START + 3600 + k * STEP for k in range(row, COUNT)}, 20)
    assert clock.stray == 0
    assert clock.end == pytest.approx((START + 3600 + (COUNT - 1) * STEP) * 1e9)
