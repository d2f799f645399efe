"""A tab: lines that lead to rows of the list, or stand for filters."""

from __future__ import annotations

from typing import TYPE_CHECKING

from textual.message import Message

from analyzer.browser.screen.lines import RIGHT, Pane, padded
from analyzer.browser.screen.styles import NAMED
from analyzer.report.lines import wrap
from analyzer.views.terminal import display_width, fit

if TYPE_CHECKING:
    from collections.abc import Sequence

    from textual import events

    from analyzer.browser.screen.lines import Spans
    from analyzer.browser.supply import TabLine


_MOST_WHOLE = 4  # lines of the current line in full


class TabPane(Pane, can_focus=True):
    """Shows the lines of a tab; one of them is the current one."""

    class Chosen(Message):
        """The current line was clicked twice."""

    class Asked(Message):
        """The current line was clicked with the right button."""

    def __init__(self) -> None:
        super().__init__("tab")
        self.title, self.empty = "", ""
        self._all: Sequence[TabLine] = ()
        self._at = self._top = self._left = 0
        self._places: dict[str, int] = {}

    def take(self, title: str, lines: Sequence[TabLine] | None, empty: str) -> None:
        """Show a tab; `empty` stands in place of lines that are not known yet."""
        if title != self.title:
            self._places[self.title] = self._at
            self._at, self._left = self._places.get(title, 0), 0
        self.title, self._all, self.empty = title, lines or (), "" if lines is not None else empty
        self.draw()

    @property
    def line(self) -> TabLine | None:
        """The current line."""
        return self._all[self._at] if self._at < len(self._all) else None

    def move(self, by: int) -> None:
        """Go so many lines further."""
        self._at = max(0, min(self._at + by, len(self._all) - 1))
        self.draw()

    def shift(self, by: int) -> None:
        """Show what stands further to the right, or left."""
        self._left = max(0, self._left + by)
        self.draw()

    def draw(self) -> None:
        """Draw the lines that are seen."""
        width, height = self.size
        if not width or height < 1:
            return
        self._at = max(0, min(self._at, len(self._all) - 1))
        whole = self._whole(width)
        room = max(1, height - 1 - len(whole))
        self._top = max(0, min(self._top, self._at, max(0, len(self._all) - room)))
        if self._at >= self._top + room:
            self._top = self._at - room + 1
        more = f"  {self._at + 1}/{len(self._all)}" if len(self._all) > room else ""
        style = NAMED["title" if self.has_focus else "head"]
        shown: list[Spans] = [((padded(fit(f" {self.title}{more}", width), width), style),)]
        for k, line in enumerate(self._all[self._top : self._top + room], self._top):
            own = NAMED.get(line.style, NAMED[""])
            own = own + NAMED["focus"] if k == self._at else own
            shown.append(((padded(fit(f" {line.text[self._left :]}", width), width), own),))
        if self.empty:
            shown.append(((padded(f"  {self.empty}", width), NAMED["dim"]),))
        if whole:
            shown += [((" ", NAMED[""]),)] * (height - len(whole) - len(shown))
            shown += [((padded(f" {text}", width), NAMED["head"]),) for text in whole]
        self.put(shown)

    def _whole(self, width: int) -> list[str]:
        """Return the current line in full, below the others, if it is too long for its own."""
        line = self.line
        if line is None or display_width(line.text) < width:
            return []
        return wrap(line.text, max(8, width - 2))[:_MOST_WHOLE]

    def on_mouse_down(self, event: events.MouseDown) -> None:
        """Go to a line; once more chooses it."""
        place = self._top + event.y - 1
        if event.y < 1 or place >= len(self._all):
            return
        if event.button == RIGHT:
            self.post_message(self.Asked())
        elif place == self._at:
            self.post_message(self.Chosen())
        self.move(place - self._at)

    def on_mouse_scroll_down(self, _: events.MouseScrollDown) -> None:
        """Go on."""
        self.move(3)

    def on_mouse_scroll_up(self, _: events.MouseScrollUp) -> None:
        """Go back."""
        self.move(-3)
