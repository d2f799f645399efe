"""Frames that several senders lack at the same time: the recorder lost them, whether or not it says so.

Senders do not know of each other, so they do not lose transfers together; unless the bus was full or broken, which its
load and error frames show. What is missing of a sender may have been sent anywhere between two of its frames. Losses
are joint where such stretches of enough senders meet, or where they follow each other closely within a time.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer._native import joint
from analyzer.decode.sent import cells
from analyzer.rules.bus.sessions import CODE_BITS
from analyzer.rules.joint.lack_rows import LackRows
from analyzer.rules.joint.lacks import Lacks
from analyzer.rules.joint.repeats import Repeats
from analyzer.rules.joint.silences import Silences
from analyzer.rules.joint.strain import Strain
from analyzer.rules.joint.times import LONGEST, SETTLED, WIDEST, WINDOW
from analyzer.tables import distinct
from dissectors.kit import MILLISECOND, NO_TIME, JointLosses

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from dissectors.kit import Array, View

ENOUGH = 3  # senders, or all if there are only two
APART = 32  # frames of the bus between losses that follow each other closely
NEARBY = 32 * MILLISECOND  # so far apart are stretches that meet
_MOST = 1 << 17  # that are waited for


class _Waiting(NamedTuple):
    """The lacks of one bus, and which of them have been told."""

    lacks: LackRows
    told: Array


class _Joint(NamedTuple):
    """Which lacks are joint, how many senders lack frames there, since when and until when."""

    which: Array
    senders: Array
    since: Array
    until: Array


class JointLossSearch:
    """Collects what each sender lacks, and tells what is joint once nothing more can be known of it."""

    def __init__(self) -> None:
        self._lacks = Lacks()
        self._strain = Strain()
        self._silences = Silences()
        self._repeats = Repeats()
        self._open: dict[int, _Waiting] = {}

    def feed(self, view: View, bits: Array) -> JointLosses:
        """Add a batch; return what is settled now."""
        self._silences.feed(view)
        self._repeats.feed(view.frames)
        self._wait(*self._lacks.feed(view))
        self._strain.feed(view, bits)
        found = self._settle(view, view.end - SETTLED) if view.end != NO_TIME else _joined([])
        since = (int(waiting.lacks.since.min(initial=view.end)) for waiting in self._open.values())
        self._strain.forget(min(*since, view.end, view.end - SETTLED) - LONGEST)
        return found

    def finish(self, view: View) -> JointLosses:
        """Return the rest."""
        return self._settle(view, None)

    def _wait(self, new: LackRows, gone: Array) -> None:
        """Add what is missing; `gone` are frames behind which nothing is missing after all."""
        buses = new.session >> CODE_BITS
        for bus, waiting in self._open.items() if len(gone) else ():
            lacks = waiting.lacks
            self._open[bus] = waiting._replace(lacks=lacks._replace(void=lacks.void | np.isin(lacks.behind, gone)))
        for bus in distinct(buses):
            ours = new.take(_together(np.flatnonzero(buses == bus)))
            since, took = self._silences.shorten(bus, ours.since, ours.until)
            ours = ours._replace(since=since).take(_together(np.flatnonzero(took <= LONGEST)))
            waiting = self._open.get(bus) or _Waiting(LackRows.none(), np.zeros(0, bool))
            room = max(_MOST - len(waiting.told), 0)
            if len(ours.since) > room:
                ours = ours.take(slice(room))
            told = np.concatenate((waiting.told, np.zeros(len(ours.since), bool)))
            self._open[bus] = _Waiting(LackRows.joined([waiting.lacks, ours]), told)

    def _settle(self, view: View, now: int | None) -> JointLosses:
        found: list[JointLosses] = []
        for bus, (lacks, before) in self._open.items():
            until = lacks.until
            due = ~before if now is None else ~before & (until <= now)
            if not due.any():
                continue
            told = before | due
            found += self._told(view, bus, lacks, due)
            if now is not None:
                late = _together(np.flatnonzero(until > now - SETTLED))
                self._open[bus] = _Waiting(lacks.take(late), told[late])
        return _joined(found)

    def _told(self, view: View, bus: int, lacks: LackRows, due: Array) -> Iterator[JointLosses]:
        """Yield what is joint of those that are due."""
        fit = self._lacks.known(lacks, WIDEST) & ~lacks.void
        joint = self._joint(bus, lacks, np.flatnonzero(fit))
        again = self._repeats.among(lacks, joint.which)
        if again.any():
            fit[joint.which[again]] = False
            joint = self._joint(bus, lacks, np.flatnonzero(fit))
        good = due[joint.which]
        good[good] = ~self._strain.on(bus, joint.since[good], joint.until[good], view.bit_rate)
        if not good.any():
            return
        begun, at = np.unique(lacks.since[joint.which], return_inverse=True)
        latest = np.zeros(len(begun), np.int64)
        np.maximum.at(latest, at, lacks.number[joint.which])
        which, since = joint.which[good], joint.since[good]
        number, window = lacks.number[which], lacks.window[which]
        place = np.minimum(np.searchsorted(begun, since), len(begun) - 1)
        yield JointLosses(
            np.full(len(since), bus), since, joint.until[good], number, lacks.behind[which], joint.senders[good],
            window - WINDOW, np.where(begun[place] == since, latest[place], number),
        )  # fmt: skip

    def _joint(self, bus: int, lacks: LackRows, some: Array) -> _Joint:
        """Return those that are joint among some rows."""
        since, until, place, behind, window = (
            column[some] for column in (lacks.since, lacks.until, lacks.place, lacks.place_behind, lacks.window)
        )
        found = joint((since, until, place, behind, window, lacks.node[some].astype(np.uint8)), APART, NEARBY)
        of, near, begun, ended = (cells(column, np.int64) for column in found)
        senders = np.searchsorted(self._lacks.nodes(bus), (until + window)[of], "right")
        enough = near >= np.clip(senders, 2, ENOUGH)
        return _Joint(some[of[enough]], near[enough], begun[enough], ended[enough])


def _together(rows: Array) -> Array | slice:
    """Return rows in order as one slice if they follow each other: then nothing is copied."""
    if len(rows) and rows.item(-1) - rows.item(0) == len(rows) - 1:
        return slice(rows.item(0), rows.item(-1) + 1)
    return rows


_NONE = JointLosses._make([np.empty(0, np.int64)] * len(JointLosses._fields))


def _joined(parts: Sequence[JointLosses]) -> JointLosses:
    if len(parts) < 2:
        return parts[0] if parts else _NONE
    return JointLosses(*map(np.concatenate, zip(_NONE, *parts, strict=True)))
