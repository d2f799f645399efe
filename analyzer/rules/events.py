"""Events of a batch for the rules: error frames, drops, and occurrences that have no frame and no node."""

from __future__ import annotations

import math
from bisect import bisect_left
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.facts.error_frames import kind_of, overflowed
from analyzer.tables import EVENTS
from dissectors.kit import NO_TIME, Occurrences

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from dissectors.kit import Array, Values, View

# Times that are kept of a bus, more than there are in two batches, and those that are forgotten at once.
LATEST, SPARE = 1 << 18, 1 << 12
EVERY_BUS = -1  # of an event that names none
_DROP, _ERROR_FRAME = EVENTS.index("drop"), EVENTS.index("error frame")


class Drop(NamedTuple):
    """Frames lost by the recorder; `bus` is `EVERY_BUS` if it does not say on which. `frames` is 0 if unknown."""

    row: int
    t: int
    bus: int
    frames: int


def drops_in(view: View) -> Iterator[Drop]:
    """Yield what the recorder says that it lost, in this batch: `row` is that of the event."""
    events = view.events
    if not len(events):
        return
    buses = _buses(view)
    for row in np.flatnonzero((events.kind == _DROP) | (events.kind == _ERROR_FRAME)).tolist():
        if events.kind[row] == _DROP:
            yield Drop(row, when(view, row), int(buses[row]), int(events.number[row]))
        elif overflowed(int(events.number[row]), events.data(row)):
            yield Drop(row, when(view, row), int(buses[row]), 0)


def error_frames(view: View) -> Iterator[tuple[int, int, str]]:
    """Yield row, bus and kind of each error frame, but for those that only say that frames were lost."""
    events = view.events
    if not len(events):
        return
    buses = _buses(view)
    # They are rare, or the bus is broken: one by one.
    for row in np.flatnonzero(events.kind == _ERROR_FRAME).tolist():
        error_class, data = int(events.number[row]), events.data(row)
        if not overflowed(error_class, data):
            yield row, int(buses[row]), kind_of(error_class, data)


def when(view: View, row: int) -> int:
    """Return the time of an event; one without a time happened when the frame before it did."""
    t = int(view.events.t[row])
    if t != NO_TIME:
        return t
    at = int(np.searchsorted(view.frames.line, view.events.line[row]))
    return int(view.frames.t[at - 1]) if at else view.before


def among_events(rule: str, view: View, rows: Array, t: Array, values: Callable[[int], Values]) -> Occurrences:
    """Return breaches in rows of the events; `values` is asked with the place in `rows`."""
    none = np.full(len(rows), -1)
    return Occurrences(
        rule=rule, t=t, bus=_buses(view)[rows], node=none, type=none, frame=none, values=values, frames=lambda _: (),
    )  # fmt: skip


class EventTimes:
    """Times of events by bus, in order; those of `EVERY_BUS` count for each.

    A bus has at most so many, which are the first ones; and in any case at most `LATEST`, which are the latest.
    """

    def __init__(self, most: float = math.inf) -> None:
        self._most = most
        self._times: dict[int, list[int]] = {}

    def __bool__(self) -> bool:
        """Return whether there is any."""
        return any(self._times.values())

    def add(self, bus: int, t: int) -> None:
        """Note a time, unless it is `NO_TIME` or known."""
        times = self._times.setdefault(bus, [])
        at = bisect_left(times, t)
        if t != NO_TIME and len(times) < self._most and times[at : at + 1] != [t]:
            times.insert(at, t)
            if len(times) > LATEST + SPARE:
                del times[:-LATEST]

    def near(self, bus: int, since: int, until: int) -> bool:
        """Return whether one lies between two times, or at one of them."""
        for times in (self._times.get(bus), self._times.get(EVERY_BUS)):
            if times:
                at = bisect_left(times, since)
                if at < len(times) and times[at] <= until:
                    return True
        return False

    def forget(self, before: int) -> None:
        """Forget what was before a time."""
        for times in self._times.values():
            del times[: bisect_left(times, before)]


def _buses(view: View) -> Array:
    events = view.events
    return np.where(events.has("bus"), events.bus.astype(np.int64), EVERY_BUS)
