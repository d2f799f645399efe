"""From a row to those that belong to it: of the same sender or type, the answer, the next finding, event or mark."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.browser.screen.moving import Moving
from analyzer.browser.walk import Walk, counterpart, next_place, same_sender, same_type, sender_before

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.browser.walk import Wanted


class Walking(Moving):
    """The part of the browser that goes from a row to others of its kind."""

    walk: Walk | None = None

    def action_sender(self, step: int) -> None:
        """Go to the next transfer of the same sender and type."""
        row = self.view.current()
        own = None if row is None else self.view.sender(row)
        otherwise = "no other transfer of this sender and type there"
        if row is None or own is None:
            self.fail("only transfers have a sender and a type")
        elif step < 0:
            self.go_to(sender_before(self.view, row), otherwise)
        else:
            self._walk(step, same_sender(self.view, own), otherwise)

    def action_type(self, step: int) -> None:
        """Go to the next transfer of the same type, whoever sent it."""
        row = self.view.current()
        own = None if row is None else self.view.sender(row)
        if own is None:
            self.fail("only transfers have a type")
        else:
            self._walk(step, same_type(own), "no other transfer of this type there")

    def action_counterpart(self) -> None:
        """Go from a request to its response, and back."""
        row = self.view.current()
        own = None if row is None else self.view.sender(row)
        if own is None or not self.view.is_service(own):
            self.fail("only requests and responses have a counterpart")
            return
        wanted = counterpart(own)
        asked = wanted["kind"] > own["kind"]
        self._walk(1 if asked else -1, wanted, "no answer to it is there" if asked else "nobody asked")

    def _walk(self, step: int, wanted: Wanted, otherwise: str) -> None:
        if self.view.anchor is None:
            return
        self.end_walk()
        self.walk = Walk(self.view.store, self.view.anchor, step, wanted, otherwise)
        self.walk.begin()
        self.wait_for_walk()

    def wait_for_walk(self) -> None:
        """Go to the row that is walked to, if it is known now."""
        walk = self.walk
        if walk is None:
            return
        if not walk.done:
            self.say("looking for it ... (esc ends that)")
            return
        self.walk = None
        self.go_to(walk.target, walk.otherwise)

    def end_walk(self) -> bool:
        """Walk no further; return whether it was walked."""
        walk, self.walk = self.walk, None
        if walk is not None:
            walk.stop()
        return walk is not None

    def action_finding(self, step: int) -> None:
        """Go to the next place at which a finding begins."""
        supply = self.view.supply
        if supply.named is None:
            self.fail("findings are not known yet: the capture is still being judged")
            return
        self._go_to_next(supply.starts, step, "finding")

    def action_event(self, step: int) -> None:
        """Go to the next event, or the next begin or end of a flight."""
        places = self.view.supply.places
        self._go_to_next(sorted(places), step, "event")

    def action_marked(self, step: int) -> None:
        """Go to the next mark."""
        self._go_to_next(sorted({*self.view.marks.marks, *self.view.supply.remarks}), step, "mark")

    def _go_to_next(self, places: Sequence[int], step: int, what: str) -> None:
        row = self.view.current()
        now = -1 if row is None else row.place
        own = self.view.places_of(row) if row is not None else []
        now = max(own, default=now) if step > 0 else min(own, default=now)
        target = next_place(places, now, step)
        if target is None:
            self.fail(f"no {what} {'behind' if step > 0 else 'before'} this row")
        elif self.go_to_frame(target) and what != "finding":
            self.say(self.view.said_of(target) if what == "mark" else self.view.supply.places[target])
