"""The frames of a session before another one, as they are looked for from the nearest one on."""

from __future__ import annotations

from bisect import bisect_left
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

from hypothesis import given
from hypothesis import strategies as st

from analyzer.rules.transfers.out_of_order import NEAR, preceding
from dissectors.kit import Kept

if TYPE_CHECKING:
    from dissectors.kit import View

BUS, SESSION, BATCH = 1, 0x1234, 1000


class _Past:
    """Frames of one session in batches of `BATCH`, some of which are gone."""

    def __init__(self, numbers: set[int], gone: set[int]) -> None:
        self.numbers, self.gone = sorted(numbers), gone

    def indexes(self, low: int, high: int) -> list[Any]:
        """Return the batches with frames between two numbers."""
        return [
            SimpleNamespace(numbers=lambda *wanted, at=at: self.of_batch(at, *wanted))
            for at in range(low // BATCH, -(-high // BATCH))
        ]

    def of_batch(self, at: int, low: int, high: int, bus: int, session: int) -> list[int]:
        """Return the frames of a batch between two numbers, in order."""
        assert (bus, session) == (BUS, SESSION)
        begin, end = max(low, at * BATCH), min(high, (at + 1) * BATCH)
        return self.numbers[bisect_left(self.numbers, begin) : bisect_left(self.numbers, end)]

    def frame(self, number: int) -> Kept | None:
        """Return a frame that is not gone; every third one has no data."""
        return None if number in self.gone else Kept(0, BUS, 0, 0, b"\xc0" if number % 3 else b"", 0)


@given(st.sets(st.integers(0, 9000)), st.sets(st.integers(0, 9000)), st.integers(0, 9000))
def test_all_frames_with_data_come_the_last_one_first(numbers: set[int], gone: set[int], number: int) -> None:
    past = cast("View", _Past(numbers, gone))
    found = [one for one, _ in preceding(past, number, BUS, SESSION)]
    wanted = [one for one in numbers - gone if number - NEAR <= one < number and one % 3]
    assert found == sorted(wanted, reverse=True)
