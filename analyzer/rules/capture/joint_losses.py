"""Frames that the recorder lost without saying so."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from analyzer.facts.identifiers import NOBODY
from analyzer.rules.events import EventTimes, drops_in
from analyzer.rules.joint.times import LONGEST, SETTLED
from dissectors.kit import NO_TIME, SECOND, Occurrences, Rule

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import View


class Inferred(Rule):
    """CAP-006: several senders lack frames at the same time, and the recorder does not say that it lost them."""

    rules: ClassVar[tuple[str, ...]] = ("CAP-006",)

    def __init__(self) -> None:
        self._told = EventTimes()  # what the recorder says that it lost

    def feed(self, view: View) -> Iterator[Occurrences]:
        """Yield the places that are settled with this batch."""
        for drop in drops_in(view):
            self._told.add(drop.bus, drop.t)
        yield from self._places(view)
        if view.end != NO_TIME:
            self._told.forget(view.end - self._around(view) - 2 * (LONGEST + SETTLED))

    def finish(self, view: View) -> Iterator[Occurrences]:
        """Yield the rest."""
        yield from self._places(view)

    def _places(self, view: View) -> Iterator[Occurrences]:
        around = self._around(view)
        found = [
            one
            for one in view.joint_losses
            if not self._told or not self._told.near(one.bus, one.since - around, one.until + around)
        ]
        if not found:
            return
        t, bus, frame = np.array([(one.since, one.bus, one.place) for one in found], np.int64).T
        nobody = np.full(len(found), NOBODY)
        yield Occurrences(
            rule="CAP-006", t=t, bus=bus, node=nobody, type=nobody, frame=frame,
            values=lambda k: {"senders": found[k].senders},
            frames=lambda k: tuple(dict.fromkeys((found[k].place, *found[k].frames))),
            drops=False, each_named=True,
        )  # fmt: skip

    def _around(self, view: View) -> int:
        return round(view.number("CAP-004", "around_s") * SECOND)
