"""Frames that the recorder lost explain what is broken close to them: that becomes a note.

It says so, or several senders lack some at the same time.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

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
        self._joint: dict[int, Array] = {}  # since when (first row), and until when, without overlaps
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
        times = np.stack((joint.since - joint.reach, joint.until + joint.reach))
        for bus in distinct(joint.bus):
            new = times[:, joint.bus == bus]
            known = self._joint.get(bus, new[:, :0])
            over = int(known[1].searchsorted(new[0].min()))  # these meet none of the new ones
            new = _without_overlaps(np.concatenate((known[:, over:], new), axis=1))
            self._joint[bus] = np.concatenate((known[:, :over], new), axis=1)[:, -MOST_JOINT:]

    def hold(self, found: Occurrences | Occurrence) -> None:
        """Keep occurrences until `ready` gives them back."""
        if isinstance(found, Occurrences):
            last = int((found.t if found.until is None else found.until).max(initial=NO_TIME))
        else:
            last = max(found.t, found.until or found.t)
        self._held.append((last, found))

    def ready(self, end: int | None) -> Iterator[tuple[Occurrences | Occurrence, Array]]:
        """Yield what no later loss can explain once the capture has come to `end` (None: to its end).

        With each comes a mask of its rows that are near a loss.
        """
        after = max(self._around, self._beside + WIDEST + LONGEST + SETTLED)
        late = [end is None or last < end - after for last, _ in self._held]
        spare = late.count(False) - MOST_HELD
        if spare > 0:
            late[: spare + late.count(True)] = [True] * (spare + late.count(True))
        done = [found for (_, found), now in zip(self._held, late, strict=True) if now]
        self._held = [entry for entry, now in zip(self._held, late, strict=True) if not now]
        told = list(united(done, self._keyed))
        if not told:
            return
        many = [one for one in told if isinstance(one, Occurrences)]
        near = self._near_each(many, [one for one in told if not isinstance(one, Occurrences)])
        begin, single = 0, sum(len(one.t) for one in many)
        for one in told:
            if isinstance(one, Occurrences):
                yield one, near[begin : begin + len(one.t)]
                begin += len(one.t)
            else:
                yield one, near[single : single + 1]
                single += 1

    def _near_each(self, many: Sequence[Occurrences], single: Sequence[Occurrence]) -> Array:
        """Return a mask of those near a loss, row by row of the first ones, then of the others."""
        columns: list[list[Any]] = [
            [one.bus for one in many],
            [one.t if one.since is None else one.since for one in many],
            [one.t if one.until is None else one.until for one in many],
        ]
        if single:
            since = (one.t if one.since is None else one.since for one in single)
            until = (one.t if one.until is None else one.until for one in single)
            columns[0].append([one.bus for one in single])
            columns[1].append([min(max(t, NO_TIME), _LAST) for t in since])
            columns[2].append([min(max(t, NO_TIME), _LAST) for t in until])
        return self._near(*(np.concatenate(parts, dtype=np.int64) for parts in columns))

    def _near(self, bus: Array, since: Array, until: Array) -> Array:
        """Return a mask of the stretches of time of a bus that are near a loss."""
        near, most = np.zeros(len(since), bool), max(self._around, self._beside)
        for one in distinct(bus) if self._times or self._joint else ():
            rows = (bus == one).nonzero()[0]
            # One without a time begins before all others; beyond the first and the last time there is nothing.
            first, last = np.maximum(since[rows], NO_TIME + most), np.minimum(until[rows], _LAST - most)
            if self._times:
                said = zip((first - self._around).tolist(), (last + self._around).tolist(), strict=True)
                near[rows] = [self._times.near(one, *each) for each in said]
            if one in self._joint:
                begins, ends = self._joint[one]
                at = ends.searchsorted(first - self._beside)
                inside = at < len(ends)
                near[rows] |= inside & (begins[np.where(inside, at, 0)] <= last + self._beside)
        return near


def _without_overlaps(times: Array) -> Array:
    """Return times with a beginning (first row) and an end as those that are left once all that meet are one."""
    times = times[:, np.argsort(times[0], kind="stable")]
    ends = np.maximum.accumulate(times[1])
    first = np.flatnonzero(np.append(True, times[0, 1:] > ends[:-1]))
    return np.stack((times[0, first], ends[np.append(first[1:], len(ends)) - 1]))
