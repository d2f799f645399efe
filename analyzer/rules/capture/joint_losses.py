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
        found = view.joint_losses
        if found is None or not len(found.bus):
            return
        if self._told:
            around = self._around(view)
            said = [self._told.near(one.bus, one.since - around, one.until + around) for one in found.each()]
            found = found.take(np.flatnonzero(~np.array(said, bool)))
        nobody = np.full(len(found.bus), NOBODY)
        places = np.stack((found.place, found.number, found.behind), axis=1)
        if len(nobody):
            yield Occurrences(
                rule="CAP-006", t=found.since, bus=found.bus, node=nobody, type=nobody, frame=found.place,
                values=lambda k: {"senders": found.senders.item(k)},
                frames=lambda k: tuple(dict.fromkeys(places[k].tolist())),
                drops=False, each_named=True,
            )  # fmt: skip

    def _around(self, view: View) -> int:
        return round(view.number("CAP-004", "around_s") * SECOND)
