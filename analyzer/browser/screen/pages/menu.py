"""The menu of what can be done with the selected field, row or line: each entry says the key that does the same."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from analyzer.browser.screen.lines import padded
from analyzer.browser.screen.pages.page import ScreenPage
from analyzer.browser.screen.styles import NAMED
from analyzer.views.terminal import fit

if TYPE_CHECKING:
    from collections.abc import Sequence

    from textual import events

    from analyzer.browser.screen.lines import Spans


class MenuEntry(NamedTuple):
    """An action on offer: the keys that do the same, the words, and the action."""

    keys: str
    words: str
    action: str


class MenuPage(ScreenPage):
    """Offers entries; ends with the action of the one that was chosen, empty for none."""

    def __init__(self, title: str, entries: Sequence[MenuEntry]) -> None:
        super().__init__()
        self._title, self._entries = title, entries
        self._at = self._top = 0
        self._keys = ""  # pressed so far, of an entry with several

    def shown(self, width: int, height: int) -> list[Spans]:
        """Return the entries that fit, the current one among them."""
        room = max(1, height - 2)
        self._top = max(0, min(self._top, self._at, len(self._entries) - room), self._at - room + 1)
        shown: list[Spans] = [((padded(fit(f" {self._title}", width), width), NAMED["title"]),)]
        for k, one in enumerate(self._entries[self._top : self._top + room], self._top):
            keys, words = f" {one.keys:<5}", padded(fit(one.words, width - 6), width - 6)
            styles = ("focus", "focus") if k == self._at else ("bold", "")
            shown.append(((keys, NAMED[styles[0]]), (words, NAMED[styles[1]])))
        shown += [((" ", NAMED[""]),)] * (height - 1 - len(shown))
        return [*shown, ((" up, down and enter, or a key or click; esc leaves", NAMED["dim"]),)]

    def move(self, by: int) -> None:
        """Go to another entry."""
        self._at = max(0, min(self._at + by, len(self._entries) - 1))
        self.draw()

    def take(self, event: events.Key) -> None:
        """Go on with keys of an entry, also by letters that move otherwise."""
        if self._keys and event.character is not None:
            self.pressed(event)
        else:
            self._keys = ""
            super().take(event)

    def pressed(self, event: events.Key) -> None:
        """Choose an entry, or leave."""
        self._keys += event.character or ""
        fitting = [one for one in self._entries if self._keys and one.keys.startswith(self._keys)]
        if not fitting or fitting[0].keys == self._keys:
            self._keys = ""
        if fitting:
            if not self._keys:
                self.leave(fitting[0].action)
        elif event.key in ("enter", "space"):
            self.leave(self._entries[self._at].action if self._entries else "")
        elif event.key in ("escape", "q", "left", "ctrl+c", "f10"):
            self.leave()

    def on_mouse_down(self, event: events.MouseDown) -> None:
        """Choose an entry; a click beside them leaves."""
        at = self._top + event.y - 1
        self.leave(self._entries[at].action if event.y >= 1 and at < len(self._entries) else "")
        if self.chosen:
            self.app.call_later(self.app.run_action, self.chosen)
