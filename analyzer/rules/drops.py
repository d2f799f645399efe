"""Frames that the recorder lost explain what is broken close to them: that becomes a note.

It says so, or several senders lack some at the same time.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.rules.events import EventTimes, drops_in
from analyzer.rules.joint.times import LONGEST, SETTLED, WIDEST
from analyzer.rules.joint.united import united
from analyzer.tables import distinct
from dissectors.kit import NO_TIME, Occurrences

if TYPE_CHECKING:
    from collections.abc import Container, Iterator, Sequence

    from dissectors.kit import Array, JointLosses, Occurrence, View

MOST_HELD = 4096
MOST_JOINT = 1 << 16  # losses of a bus that are inferred
_LAST = (1 << 63) - 1  # time that there is


class Drops:
    """Holds occurrences back until it is known whether frames were lost around them.

    Args:
        around: how close to what the recorder says counts, in nanoseconds.
        beside: how close to what it does not say.
        keyed: rules whose findings are kept apart by values.
    """

    def __init__(self, around: int, beside: int, keyed: Container[str] = ()) -> None:
        self._keyed = keyed
        self._around = around
        self._beside = beside
        self._times = EventTimes()  # of what the recorder says
        self._joint: dict[int, Array] = {}  # since when, and until when, without overlaps: a row each
        self._held: list[tuple[int, Occurrences | Occurrence]] = []

    def feed(self, view: View) -> None:
        """Note the losses of a batch."""
        for drop in drops_in(view):
            self._times.add(drop.bus, drop.t)
        self.add(view.joint_losses)

    def add(self, joint: JointLosses | None) -> None:
        """Note losses that are inferred."""
        if joint is None:
            return
        rows = np.stack((joint.since - joint.reach, joint.until + joint.reach), axis=1)
        for bus in distinct(joint.bus):
            new = rows[joint.bus == bus]
            self._joint[bus] = _without_overlaps(np.concatenate((self._joint.get(bus, new[:0]), new)))[-MOST_JOINT:]

    def hold(self, found: Occurrences | Occurrence) -> None:
        """Keep occurrences until `ready` gives them back."""
        if isinstance(found, Occurrences):
            last = int((found.t if found.until is None else found.until).max(initial=NO_TIME))
        else:
            last = max(found.t, found.until or found.t)
        self._held.append((last, found))

    def ready(self, end: int | None) -> Iterator[tuple[Occurrences | Occurrence, list[bool]]]:
        """Yield what no later loss can explain once the capture has come to `end` (None: to its end)."""
        after = max(self._around, self._beside + WIDEST + LONGEST + SETTLED)
        late = [k for k, (last, _) in enumerate(self._held) if end is None or last < end - after]
        spare = len(self._held) - len(late) - MOST_HELD
        chosen = set(late) if spare <= 0 else set(late) | set(range(spare + len(late)))
        done = [found for k, (_, found) in enumerate(self._held) if k in chosen]
        self._held = [entry for k, entry in enumerate(self._held) if k not in chosen]
        told = list(united(done, self._keyed))
        alone = iter(self._near_each([one for one in told if not isinstance(one, Occurrences)]))
        for one in told:
            if isinstance(one, Occurrences):
                since, until = (one.t if times is None else times for times in (one.since, one.until))
                yield one, self._near(one.bus, since, until)
            else:
                yield one, [next(alone)]

    def _near_each(self, found: Sequence[Occurrence]) -> list[bool]:
        """Return which occurrences are near a loss."""
        times = ((one.t if time is None else time for time in (one.since, one.until)) for one in found)
        rows = [
            (one.bus, *(min(max(time, NO_TIME), _LAST) for time in each))
            for one, each in zip(found, times, strict=True)
        ]
        return self._near(*np.array(rows, np.int64).reshape(-1, 3).T)

    def _near(self, bus: Array, since: Array, until: Array) -> list[bool]:
        """Return which stretches of time of a bus are near a loss."""
        near, most = np.zeros(len(since), bool), max(self._around, self._beside)
        for one in distinct(bus) if self._times or self._joint else ():
            rows = np.flatnonzero(bus == one)
            # One without a time begins before all others; beyond the first and the last time there is nothing.
            first, last = np.maximum(since[rows], NO_TIME + most), np.minimum(until[rows], _LAST - most)
            if self._times:
                said = zip((first - self._around).tolist(), (last + self._around).tolist(), strict=True)
                near[rows] = [self._times.near(one, *each) for each in said]
            if one in self._joint:
                begins, ends = self._joint[one].T
                at = np.searchsorted(ends, first - self._beside)
                inside = at < len(ends)
                near[rows] |= inside & (begins[np.where(inside, at, 0)] <= last + self._beside)
        found: list[bool] = near.tolist()
        return found


def _without_overlaps(times: Array) -> Array:
    """Return times with a beginning and an end as those that are left once all that meet are one."""
    times = times[np.argsort(times[:, 0], kind="stable")]
    ends = np.maximum.accumulate(times[:, 1])
    first = np.flatnonzero(np.append(True, times[1:, 0] > ends[:-1]))
    return np.stack((times[first, 0], ends[np.append(first[1:], len(ends)) - 1]), axis=1)
