"""Frames that the recorder lost explain what is broken close to them: that becomes a note.

It says so, or several senders lack some at the same time.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.facts.error_frames import overflowed
from analyzer.rules.joint.times import LONGEST, SETTLED
from analyzer.tables import EVENTS
from dissectors.kit import NO_TIME, Occurrences

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from dissectors.kit import JointLoss, Occurrence, View

_DROP, _ERROR_FRAME = EVENTS.index("drop"), EVENTS.index("error frame")
MOST_HELD = 4096
EVERY_BUS = -1


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
    has_bus = events.has("bus")
    for row in np.flatnonzero((events.kind == _DROP) | (events.kind == _ERROR_FRAME)).tolist():
        bus = int(events.bus[row]) if has_bus[row] else EVERY_BUS
        if events.kind[row] == _DROP:
            yield Drop(row, when(view, row), bus, int(events.number[row]))
        elif overflowed(int(events.number[row]), events.data(row)):
            yield Drop(row, when(view, row), bus, 0)


def when(view: View, row: int) -> int:
    """Return the time of an event; one without a time happened when the frame before it did."""
    t = int(view.events.t[row])
    if t != NO_TIME:
        return t
    at = int(np.searchsorted(view.frames.line, view.events.line[row]))
    return int(view.frames.t[at - 1]) if at else view.before


class Drops:
    """Holds occurrences back until it is known whether frames were lost around them.

    Args:
        around: how close to what the recorder says counts, in nanoseconds.
        beside: how close to what it does not say.
    """

    def __init__(self, around: int, beside: int) -> None:
        self._around = around
        self._beside = beside
        self._times: dict[int, list[int]] = {}
        self._joint: dict[int, list[tuple[int, int]]] = {}  # since when, and until when, without overlaps
        self._held: list[tuple[int, Occurrences | Occurrence]] = []

    def feed(self, view: View) -> None:
        """Note the losses of a batch."""
        for drop in drops_in(view):
            times = self._times.setdefault(drop.bus, [])
            if drop.t != NO_TIME and (not times or drop.t > times[-1]):
                times.append(drop.t)
        self.add(view.joint_losses)

    def add(self, joint: Iterable[JointLoss]) -> None:
        """Note losses that are inferred."""
        for one in joint:
            known = self._joint.setdefault(one.bus, [])
            since, until = one.since, one.until
            at = bisect_left(known, since, key=lambda loss: loss[1])
            end = bisect_right(known, until, key=lambda loss: loss[0])
            if at < end:
                since, until = min(since, known[at][0]), max(until, known[end - 1][1])
            known[at:end] = [(since, until)]

    def hold(self, found: Occurrences | Occurrence) -> None:
        """Keep occurrences until `ready` gives them back."""
        if isinstance(found, Occurrences):
            last = int(found.t.max(initial=NO_TIME))
        else:
            last = max(found.t, found.until or found.t)
        self._held.append((last, found))

    def ready(self, end: int | None) -> Iterator[tuple[Occurrences | Occurrence, list[bool]]]:
        """Yield what no later loss can explain once the capture has come to `end` (None: to its end)."""
        after = max(self._around, self._beside + LONGEST + SETTLED)
        late = [k for k, (last, _) in enumerate(self._held) if end is None or last < end - after]
        spare = len(self._held) - len(late) - MOST_HELD
        chosen = set(late) if spare <= 0 else set(late) | set(range(spare + len(late)))
        done = [entry for k, entry in enumerate(self._held) if k in chosen]
        self._held = [entry for k, entry in enumerate(self._held) if k not in chosen]
        for _, found in done:
            yield found, self._near(found)

    def _near(self, found: Occurrences | Occurrence) -> list[bool]:
        if not isinstance(found, Occurrences):
            first, last = (found.t if time is None else time for time in (found.since, found.until))
            return [self._explains(found.bus, first, last)]
        if not self._times and not self._joint:
            return [False] * len(found.t)
        since = found.t if found.since is None else found.since
        rows = zip(found.bus.tolist(), since.tolist(), found.t.tolist(), strict=True)
        return [self._explains(*row) for row in rows]

    def _explains(self, bus: int, since: int, until: int) -> bool:
        for times in (self._times.get(bus), self._times.get(EVERY_BUS)):
            if times:
                at = bisect_left(times, since - self._around)
                if at < len(times) and times[at] <= until + self._around:
                    return True
        joint = self._joint.get(bus, [])
        at = bisect_left(joint, since - self._beside, key=lambda loss: loss[1])
        return at < len(joint) and joint[at][0] <= until + self._beside
