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


_MOST_EVENTS = 500


class StripPane(Lines):
    """One line: load by time, `!` errors, `?` warnings, `o` marks, `e` events, flights in colour, and where the list stands."""

    class Went(Message):
        """A time was clicked at."""

        def __init__(self, t: int) -> None:
            super().__init__()
            self.t = t

    def __init__(self, view: BrowserView, *, plain: bool) -> None:
        super().__init__("strip")
        self._view, self.strip = view, Strip(view.store, plain=plain)
        self._places: dict[int, str] = {}
        self._times: list[int] = []

    def draw(self) -> None:
        """Draw it as it is now."""
        view, width = self._view, self.size.width
        row = view.current()
        now = None if row is None else view.store.time(row)
        marks = [one.t for one in view.marks.ordered() if one.t is not None]
        cells = self.strip.cells(
            width, now=now, flights=[one for one in view.supply.flights if None not in one],
            findings=view.supply.troubles, marks=marks, events=self._events(),
        )  # fmt: skip
        self.put([tuple((cell.sign, NAMED[cell.style]) for cell in cells)])

    def _events(self) -> list[int]:
        """Return the times of events, looked up once."""
        places = self._view.supply.places
        if places is not self._places:
            self._places = places
            times = (self._view.store.frame_time(place) for place in list(places)[:_MOST_EVENTS])
            self._times = [t for t in times if t is not None]
        return self._times

    def on_resize(self) -> None:
        """Draw as wide as it is now."""
        self.draw()

    def on_click(self, event: events.Click) -> None:
        """Go to a time."""
        t = self.strip.time_of(event.x, self.size.width)
        if t is not None:
            self.post_message(self.Went(t))
