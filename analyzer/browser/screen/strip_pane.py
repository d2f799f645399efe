"""The strip over the whole capture: a click goes to its time."""

from __future__ import annotations

from typing import TYPE_CHECKING

from textual.message import Message

from analyzer.browser.screen.lines import Lines
from analyzer.browser.screen.styles import NAMED
from analyzer.browser.strip import Strip

if TYPE_CHECKING:
    from textual import events

    from analyzer.browser.view import BrowserView


_MOST_MARKS = 1000


class StripPane(Lines):
    """One line: load by time, coloured in flights; findings and marks by their signs; where the list stands."""

    class Went(Message):
        """A time was clicked at."""

        def __init__(self, t: int) -> None:
            super().__init__()
            self.t = t

    def __init__(self, view: BrowserView, *, plain: bool) -> None:
        super().__init__("strip")
        self._view, self.strip = view, Strip(view.store, plain=plain)
        self._remarked: list[int | None] = []  # times of comments that the capture holds

    def draw(self) -> None:
        """Draw it as it is now."""
        view, width = self._view, self.size.width
        row = view.current()
        now = None if row is None else view.store.time(row)
        marks = [t for one in view.marks.ordered()[:_MOST_MARKS] if (t := view.time_of(one)) is not None]
        if len(self._remarked) < min(len(view.supply.remarks), _MOST_MARKS):
            self._remarked = [view.store.frame_time(place) for place in list(view.supply.remarks)[:_MOST_MARKS]]
        marks += [t for t in self._remarked if t is not None]
        cells = self.strip.cells(
            width, now=now, flights=view.supply.flights,
            findings=view.supply.troubles, marks=marks,
        )  # fmt: skip
        self.put([tuple((cell.sign, NAMED[cell.style]) for cell in cells)])

    def on_resize(self) -> None:
        """Draw as wide as it is now."""
        self.draw()

    def on_click(self, event: events.Click) -> None:
        """Go to a time."""
        t = self.strip.time_of(event.x, self.size.width)
        if t is not None:
            self.post_message(self.Went(t))
