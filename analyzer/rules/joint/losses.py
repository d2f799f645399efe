"""Frames that several senders lack at the same time: the recorder lost them, whether or not it says so.

Senders do not know of each other, so they do not lose transfers together; unless the bus was full or broken, which its
load and error frames show. What is missing of a sender may have been sent anywhere between two of its frames. Losses
are joint where such stretches of enough senders meet, or where they follow each other closely within a time.
"""

from __future__ import annotations

from bisect import bisect_right
from typing import TYPE_CHECKING

from analyzer.rules.joint.lacks import Lacks
from analyzer.rules.joint.repeats import Repeats
from analyzer.rules.joint.silences import Silences
from analyzer.rules.joint.strain import Strain
from analyzer.rules.joint.times import LONGEST, SETTLED, WIDEST, WINDOW
from dissectors.kit import MILLISECOND, NO_TIME, JointLoss

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from analyzer.rules.joint.lacks import Lack
    from dissectors.kit import Array, View

ENOUGH = 3  # senders, or all if there are only two
APART = 32  # frames of the bus between losses that follow each other closely
NEARBY = 32 * MILLISECOND  # so far apart are stretches that meet
_MOST = 1 << 17  # that are waited for


class JointLosses:
    """Collects what each sender lacks, and tells what is joint once nothing more can be known of it."""

    def __init__(self) -> None:
        self._lacks = Lacks()
        self._strain = Strain()
        self._silences = Silences()
        self._repeats = Repeats()
        self._open: dict[int, list[Lack]] = {}
        self._done: set[Lack] = set()

    def feed(self, view: View, bits: Array) -> list[JointLoss]:
        """Add a batch; return what is settled now."""
        self._silences.feed(view)
        self._repeats.feed(view.frames)
        for one in self._lacks.feed(view):
            waiting = self._open.setdefault(one.session.bus, [])
            if self._silences.shorten(one) <= LONGEST and len(waiting) < _MOST:
                waiting.append(one)
        self._strain.feed(view, bits)
        found = self._settle(view, view.end - SETTLED) if view.end != NO_TIME else []
        oldest = min((one.since for waiting in self._open.values() for one in waiting), default=view.end)
        self._strain.forget(min(oldest, view.end - SETTLED) - LONGEST)
        return found

    def finish(self, view: View) -> list[JointLoss]:
        """Return the rest."""
        return self._settle(view, None)

    def _settle(self, view: View, now: int | None) -> list[JointLoss]:
        found: list[JointLoss] = []
        for bus, waiting in self._open.items():
            due = {one for one in waiting if (now is None or one.until <= now) and one not in self._done}
            if not due:
                continue
            lacks = [one for one in waiting if not one.void and self._lacks.known(one, WIDEST)]
            joint = self._joint(bus, lacks)
            again = self._repeats.among(joint)
            if again:
                joint = self._joint(bus, [one for one in lacks if one not in again])
            for one, (senders, since, until) in joint.items():
                if one in due and not self._strain.on(bus, since, until, view.bit_rate):
                    found.append(JointLoss(bus, since, until, one.frames, senders, one.window - WINDOW))
            self._done |= due
            if now is not None:
                gone = [one for one in waiting if one.until <= now - SETTLED]
                self._done.difference_update(gone)
                self._open[bus] = (
                    waiting[len(gone) :]
                    if gone == waiting[: len(gone)]
                    else [one for one in waiting if one.until > now - SETTLED]
                )
        return found

    def _joint(self, bus: int, lacks: Sequence[Lack]) -> dict[Lack, tuple[int, int, int]]:
        """Return those that are joint: how many senders lack frames there, since when and until when."""
        known = sorted(self._lacks.nodes.get(bus, {}).values())
        found = {one: (count, one.since, one.until) for one, count in _close(lacks).items()}
        for one, near in _met(lacks).items():
            if near[0] >= found.get(one, (0,))[0]:
                found[one] = near
        return {
            one: near
            for one, near in found.items()
            if near[0] >= min(max(bisect_right(known, one.until + one.window), 2), ENOUGH)
        }


def _close(lacks: Iterable[Lack]) -> dict[Lack, int]:
    """Return how many senders lack frames close to each other: without a longer pause between, within a time."""
    narrow = [one for one in lacks if one.until - one.since <= one.window]
    found: dict[Lack, int] = {}
    row: list[Lack] = []
    behind = 0
    for one in sorted(narrow, key=lambda lack: lack.places):
        if row and one.places[0] - behind > APART:
            found |= _within(row)
            row = []
        behind = max(behind, one.places[1]) if row else one.places[1]
        row.append(one)
    return found | _within(row)


def _within(row: Sequence[Lack]) -> dict[Lack, int]:
    row = sorted(row, key=lambda one: one.until)
    found: dict[Lack, int] = {}
    nodes = _Nodes()
    first = last = 0
    for one in row:
        while last < len(row) and row[last].until <= one.until + one.window:
            nodes.add(row[last])
            last += 1
        while row[first].until < one.until - one.window:
            nodes.remove(row[first])
            first += 1
        found[one] = len(nodes)
    return found


def _met(lacks: Iterable[Lack]) -> dict[Lack, tuple[int, int, int]]:
    """Return at how many senders' stretches each meets most, and the time that these have in common with it."""
    every = list(lacks)
    marks = [(one.since - NEARBY, 0, k) for k, one in enumerate(every)]
    marks += [(one.until + NEARBY, 1, k) for k, one in enumerate(every)]
    open_: dict[int, Lack] = {}
    nodes = _Nodes()
    most = [0] * len(every)
    found: dict[Lack, tuple[int, int, int]] = {}
    fresh = False
    for _, ends, k in sorted(marks):
        if ends and fresh:  # no more meet here than just before the first of them ends
            fresh = False
            count = len(nodes)
            more = [at for at in open_ if count > most[at]]
            if more:
                near = open_.values()
                first, last = sorted((max(each.since for each in near), min(each.until for each in near)))
                for at in more:
                    each = every[at]
                    since, until = min(max(first, each.since), each.until), max(min(last, each.until), each.since)
                    most[at], found[each] = count, (count, since, until)
        if ends:
            nodes.remove(open_.pop(k))
        else:
            open_[k] = every[k]
            nodes.add(every[k])
            fresh = True
    return found


class _Nodes(dict[int, int]):
    """How many lacks of each sender are looked at."""

    def add(self, one: Lack) -> None:
        """Look at one more."""
        node = one.session.node
        self[node] = self.get(node, 0) + 1

    def remove(self, one: Lack) -> None:
        """Look at it no longer."""
        node = one.session.node
        self[node] -= 1
        if not self[node]:
            del self[node]
