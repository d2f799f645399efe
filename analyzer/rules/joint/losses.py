"""Frames that several senders lack at the same time: the recorder lost them, whether or not it says so.

Senders do not know of each other, so they do not lose transfers together; unless the bus was full or broken, which its
load and error frames show. What is missing of a sender may have been sent anywhere between two of its frames. Losses
are joint where such stretches of enough senders meet, or where they follow each other closely within a time.
"""

from __future__ import annotations

from itertools import chain, compress
from operator import attrgetter
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer._native import joint
from analyzer.decode.sent import cells
from analyzer.rules.joint.lacks import Lacks
from analyzer.rules.joint.repeats import Repeats
from analyzer.rules.joint.silences import Silences
from analyzer.rules.joint.strain import Strain
from analyzer.rules.joint.times import LONGEST, SETTLED, WIDEST, WINDOW
from dissectors.kit import MILLISECOND, NO_TIME, JointLoss

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analyzer.rules.joint.lacks import Lack
    from dissectors.kit import Array, View

ENOUGH = 3  # senders, or all if there are only two
APART = 32  # frames of the bus between losses that follow each other closely
NEARBY = 32 * MILLISECOND  # so far apart are stretches that meet
_MOST = 1 << 17  # that are waited for


class _Waiting:
    """The lacks of one bus, and which of them have been told."""

    def __init__(self) -> None:
        self.lacks: list[Lack] = []
        self.told: Array = np.zeros(0, bool)

    def column(self, name: str) -> Array:
        """Return an attribute of all of them."""
        return np.fromiter(map(attrgetter(name), self.lacks), np.int64, len(self.lacks))

    def keep(self, which: Array) -> None:
        """Forget all others."""
        self.lacks = list(compress(self.lacks, which.tolist()))
        self.told = self.told[which]


class _Joint(NamedTuple):
    """Which lacks are joint, how many senders lack frames there, since when and until when."""

    which: Array
    senders: Array
    since: Array
    until: Array


class JointLosses:
    """Collects what each sender lacks, and tells what is joint once nothing more can be known of it."""

    def __init__(self) -> None:
        self._lacks = Lacks()
        self._strain = Strain()
        self._silences = Silences()
        self._repeats = Repeats()
        self._open: dict[int, _Waiting] = {}

    def feed(self, view: View, bits: Array) -> list[JointLoss]:
        """Add a batch; return what is settled now."""
        self._silences.feed(view)
        self._repeats.feed(view.frames)
        for one in self._lacks.feed(view):
            waiting = self._open.setdefault(one.session.bus, _Waiting()).lacks
            if self._silences.shorten(one) <= LONGEST and len(waiting) < _MOST:
                waiting.append(one)
        self._strain.feed(view, bits)
        found = self._settle(view, view.end - SETTLED) if view.end != NO_TIME else []
        since = (int(waiting.column("since").min(initial=view.end)) for waiting in self._open.values())
        self._strain.forget(min(*since, view.end, view.end - SETTLED) - LONGEST)
        return found

    def finish(self, view: View) -> list[JointLoss]:
        """Return the rest."""
        return self._settle(view, None)

    def _settle(self, view: View, now: int | None) -> list[JointLoss]:
        found: list[JointLoss] = []
        for bus, waiting in self._open.items():
            told, until = np.zeros(len(waiting.lacks), bool), waiting.column("until")
            told[: len(waiting.told)] = waiting.told
            due = ~told if now is None else ~told & (until <= now)
            waiting.told = told | due
            if not due.any():
                continue
            found += self._told(view, bus, waiting.lacks, due)
            if now is not None:
                waiting.keep(until > now - SETTLED)
        return found

    def _told(self, view: View, bus: int, lacks: Sequence[Lack], due: Array) -> Iterator[JointLoss]:
        """Yield what is joint of those that are due."""
        known = [not one.void and self._lacks.known(one, WIDEST) for one in lacks]
        lacks, due = list(compress(lacks, known)), due[known]
        columns = _columns(lacks)
        joint = self._joint(bus, columns, np.arange(len(lacks)))
        again = self._repeats.among([lacks[k] for k in joint.which.tolist()])
        if again.any():
            joint = self._joint(bus, columns, np.delete(np.arange(len(lacks)), joint.which[again]))
        good = due[joint.which]
        good[good] = ~self._strain.on(bus, joint.since[good], joint.until[good], view.bit_rate)
        begun: dict[int, int] = {}
        for which in joint.which.tolist() if good.any() else ():
            one = lacks[which]
            begun[one.since] = max(one.frames[0], begun.get(one.since, 0))
        for which, senders, since, until in zip(*(column[good].tolist() for column in joint), strict=True):
            one = lacks[which]
            place = begun.get(since, one.frames[0])
            yield JointLoss(bus, since, until, one.frames, senders, one.window - WINDOW, place)

    def _joint(self, bus: int, columns: Array, some: Array) -> _Joint:
        """Return those that are joint among some of the rows of `columns`."""
        *given, node = columns[:, some]
        found = joint((*given, node.astype(np.uint8)), APART, NEARBY)
        of, near, since, until = (cells(column, np.int64) for column in found)
        known = np.sort(np.fromiter(self._lacks.nodes.get(bus, {}).values(), np.int64))
        _, end, _, _, window = given
        senders = np.searchsorted(known, (end + window)[of], "right")
        enough = near >= np.clip(senders, 2, ENOUGH)
        return _Joint(some[of[enough]], near[enough], since[enough], until[enough])


def _columns(lacks: Sequence[Lack]) -> Array:
    """Return since when, until when, places, window and node of each."""
    rows = ((one.since, one.until, *one.places, one.window, one.session.node) for one in lacks)
    return np.fromiter(chain.from_iterable(rows), np.int64, 6 * len(lacks)).reshape(-1, 6).T.copy()
