"""Frames that the recorder lost without saying so."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from analyzer.rules.drops import EVERY_BUS, drops_in
from analyzer.rules.joint.times import LONGEST, SETTLED
from dissectors.kit import NO_TIME, SECOND, Occurrence, Rule

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import View


class Inferred(Rule):
    """CAP-006: several senders lack frames at the same time, and the recorder does not say that it lost them."""

    rules: ClassVar[tuple[str, ...]] = ("CAP-006",)

    def __init__(self) -> None:
        self._told: list[tuple[int, int]] = []  # buses and times of what the recorder says that it lost

    def feed(self, view: View) -> Iterator[Occurrence]:
        """Yield the places that are settled with this batch."""
        self._told += [(drop.bus, drop.t) for drop in drops_in(view) if drop.t != NO_TIME]
        yield from self._places(view)
        if self._told and view.end != NO_TIME:
            oldest = view.end - self._around(view) - 2 * (LONGEST + SETTLED)
            self._told = [(bus, t) for bus, t in self._told if t >= oldest]

    def finish(self, view: View) -> Iterator[Occurrence]:
        """Yield the rest."""
        yield from self._places(view)

    def _places(self, view: View) -> Iterator[Occurrence]:
        around = self._around(view) if self._told else 0
        for one in view.joint_losses:
            first, last = one.since - around, one.until + around
            if not any(bus in (one.bus, EVERY_BUS) and first <= t <= last for bus, t in self._told):
                values = {"senders": one.senders}
                yield Occurrence("CAP-006", one.since, one.bus, None, "", one.frames, values)

    def _around(self, view: View) -> int:
        return round(view.number("CAP-004", "around_s") * SECOND)
