"""One time for rows whose times come from several clocks: it never falls, whatever these do."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.live.frame_batches import CLOCKS, NO_CLOCK
from dissectors.records import dataclass
from dissectors.times import SECOND

if TYPE_CHECKING:
    from analyzer.live.frame_batches import OrderedRows
    from dissectors.kit import Array


# Times that are further off than this are those of another clock.
_FAR = 3600 * SECOND


@dataclass(slots=True)
class _Clock:
    """The latest time that it has shown, and where that is on the axis."""

    shown: int
    at: int

    def place(self, t: int) -> int:
        return self.at + t - self.shown


class Axis:
    """Places rows on one axis of nanoseconds, which begins at 0 and is at `now`.

    Each bus has clocks of its own, as a controller may count from anywhere, and stamps no error frames. On the axis
    each goes on from where it was by as much as it says. It continues from `now` when it has been set back, and when it
    is behind `now` where a batch begins, by more than a second each; clocks that differ by less are taken for one.
    Comments, and rows without a time, are where the row before them is.
    """

    def __init__(self) -> None:
        self.now = 0
        # By bus and kind of row.
        self._clocks: dict[tuple[str, int], _Clock] = {}

    def place(self, ordered: OrderedRows) -> tuple[Array, Array]:
        """Place the next rows: how far each and all before it have come, and from where it and all behind it are.

        Neither falls in a batch. They differ where rows of one bus stand behind later ones of another.
        """
        clocks, buses = ordered.clocks(), ordered.batch.buses
        own = np.full(len(ordered), self.now)
        for number in np.unique(clocks[clocks != NO_CLOCK]).tolist():
            bus, kind = divmod(number, CLOCKS)
            rows = clocks == number
            own[rows] = self._follow((buses[bus], kind), ordered.t[rows])
        come = np.maximum.accumulate(np.maximum(own, self.now))
        own = np.where(clocks == NO_CLOCK, come, own)
        if len(come):
            self.now = int(come[-1])
        return come, np.minimum.accumulate(own[::-1])[::-1]

    def locate(self, bus: str, t: int) -> int:
        """Return where a time of a bus that has come is; `now` if no clock of it can have shown it."""
        known = sorted(key for key in self._clocks if key[0] == bus) or sorted(self._clocks)
        places = (self._clocks[key].place(t) for key in known)
        return next((place for place in places if self.now - _FAR < place <= self.now + SECOND), self.now)

    def _follow(self, key: tuple[str, int], t: Array) -> Array:
        """Return where the next times of a clock are."""
        clock = self._clocks.get(key)
        first = int(t[0])
        if clock is None:
            clock = self._clocks[key] = _Clock(first, self._first(first))
        elif clock.at + max(0, first - clock.shown) < self.now - SECOND:
            clock.shown, clock.at = first, self.now
        placed = []
        for part in np.split(t, np.flatnonzero(np.diff(t) < -SECOND) + 1):
            if part[0] < clock.shown - SECOND:
                clock.shown = int(part[0])
            shown = np.maximum.accumulate(np.maximum(part, clock.shown))
            placed.append(clock.at + (shown - clock.shown))
            clock.shown, clock.at = int(shown[-1]), int(placed[-1][-1])
        return np.concatenate(placed)

    def _first(self, t: int) -> int:
        """Return where the first time of a clock is: where it would be on another one, if they may be the same."""
        latest = max((clock.at for clock in self._clocks.values()), default=self.now)
        places = (clock.place(t) for clock in self._clocks.values())
        return next((place for place in places if self.now - SECOND <= place <= latest + SECOND), self.now)
