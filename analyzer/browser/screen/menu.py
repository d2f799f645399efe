"""The menu of what can be done with the selected field, row or line: each entry says the key that does the same."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, NamedTuple

from textual.screen import ModalScreen

from analyzer.browser.screen.lines import Lines, padded
from analyzer.browser.screen.styles import NAMED
from analyzer.views.terminal import fit

if TYPE_CHECKING:
    from collections.abc import Sequence

    from textual import events
    from textual.app import ComposeResult

    from analyzer.browser.screen.lines import Spans


class MenuEntry(NamedTuple):
    """An action on offer: the keys that do the same, the words, and the action."""

    keys: str
    words: str
    action: str


class MenuPage(ModalScreen[str]):
    """Offers entries; ends with the action of the one that was chosen, empty for none."""

    CSS: ClassVar[str] = "MenuPage { background: ansi_default; } #menu { height: 100%; }"

    def __init__(self, title: str, entries: Sequence[MenuEntry]) -> None:
        super().__init__()
        self._title, self._entries = title, entries
        self._at = self._top = 0

    def compose(self) -> ComposeResult:
        """Lay out one widget."""
        yield Lines("menu")

    def on_mount(self) -> None:
        """Show the entries."""
        self.call_after_refresh(self._draw)

    def on_resize(self) -> None:
        """Draw as large as it is now."""
        self.call_after_refresh(self._draw)

    def _draw(self) -> None:
        width, height = self.size
        room = max(1, height - 2)
        self._top = max(0, min(self._top, self._at, len(self._entries) - room), self._at - room + 1)
        shown: list[Spans] = [((padded(fit(f" {self._title}", width), width), NAMED["title"]),)]
        for k, one in enumerate(self._entries[self._top : self._top + room], self._top):
            keys, words = f" {one.keys:<5}", padded(fit(one.words, width - 6), width - 6)
            styles = ("focus", "focus") if k == self._at else ("bold", "")
            shown.append(((keys, NAMED[styles[0]]), (words, NAMED[styles[1]])))
        shown += [((" ", NAMED[""]),)] * (height - 1 - len(shown))
        self.query_one(Lines).put([*shown, ((" up, down and enter, or a key or click; esc leaves", NAMED["dim"]),)])

    def on_key(self, event: events.Key) -> None:
        """Go to an entry, choose one, or leave."""
        event.stop()
        steps = {"up": -1, "down": 1, "pageup": -20, "pagedown": 20, "k": -1, "j": 1, "home": -999, "end": 999}
        named = next((one for one in self._entries if one.keys == event.character), None)
        if named is not None:
            self.dismiss(named.action)
        elif event.key in steps:
            self._at = max(0, min(self._at + steps[event.key], len(self._entries) - 1))
            self._draw()
        elif event.key in ("enter", "space"):
            self.dismiss(self._entries[self._at].action if self._entries else "")
        elif event.key in ("escape", "q", "left", "ctrl+c", "f10"):
            self.dismiss("")

    def on_click(self, event: events.Click) -> None:
        """Choose an entry; a click beside them leaves."""
        at = self._top + event.y - 1
        self.dismiss(self._entries[at].action if event.y >= 1 and at < len(self._entries) else "")

    def on_mouse_scroll_down(self, _: events.MouseScrollDown) -> None:
        """Go on."""
        self._at = min(self._at + 3, len(self._entries) - 1)
        self._draw()

    def on_mouse_scroll_up(self, _: events.MouseScrollUp) -> None:
        """Go back."""
        self._at = max(self._at - 3, 0)
        self._draw()
