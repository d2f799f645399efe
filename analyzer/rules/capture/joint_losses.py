"""Frames that the recorder lost without saying so."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from analyzer.rules.events import EventTimes, drops_in
from analyzer.rules.joint.gathered import Gathered, Sent
from analyzer.rules.joint.times import LONGEST, SETTLED
from dissectors.kit import NO_TIME, SECOND, Rule

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Occurrences, View


class Inferred(Rule):
    """CAP-006: several senders lack frames at the same time, and the recorder does not say that it lost them."""

    rules: ClassVar[tuple[str, ...]] = ("CAP-006",)

    def __init__(self) -> None:
        self._told = EventTimes()  # what the recorder says that it lost
        self._found = Gathered()

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
        for one in view.joint_losses:
            if not self._told.near(one.bus, one.since - around, one.until + around):
                self._found.add("CAP-006", Sent(one.since, one.bus), one.frames, {"senders": one.senders}, drops=False)
        yield from self._found.occurrences()

    def _around(self, view: View) -> int:
        return round(view.number("CAP-004", "around_s") * SECOND)
