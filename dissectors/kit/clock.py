"""The times of a batch's frames by bus, and how far they are apart: most rules ask whether that is as usual."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

from dissectors.kit.rows import rows_by_bus

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dissectors.kit.array import Array
    from dissectors.kit.tables import FrameTable


class BusTimes:
    """The frames of a bus that have a time: `rows` of the batch, None for all of it, and their times `t`."""

    def __init__(self, bus: int, rows: Array | None, t: Array) -> None:
        self.bus, self.rows, self.t = bus, rows, t

    @property
    def steady(self) -> bool:
        """True if no time is less than the one before it."""
        return self._steps[0] >= 0

    @property
    def longest(self) -> int:
        """The longest time from one frame to the next, in ns."""
        return self._steps[1]

    @property
    def back(self) -> int:
        """How far a clock is set back from one frame to the next, at most, in ns."""
        return -min(self._steps[0], 0)

    @cached_property
    def _steps(self) -> tuple[int, int]:
        apart = self.t[1:] - self.t[:-1]
        return int(apart.min(initial=0)), int(apart.max(initial=0))


_known: WeakKeyDictionary[FrameTable, Sequence[BusTimes]] = WeakKeyDictionary()


def times_by_bus(frames: FrameTable) -> Sequence[BusTimes]:
    """Return the times of each bus; what is made for one rule serves all."""
    if frames not in _known:
        found = rows_by_bus(frames.bus, frames.t)
        _known[frames] = [BusTimes(bus, rows, frames.t if rows is None else frames.t[rows]) for bus, rows in found]
    return _known[frames]
