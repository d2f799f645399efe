"""Keys: each is done before the next one, however many a slow line brings at once."""

from __future__ import annotations

from typing import TYPE_CHECKING

from textual.events import Key, Paste

from analyzer.browser.screen.keys import EVERY
from analyzer.browser.screen.offering import Offering
from analyzer.browser.screen.pages.page import ScreenPage

if TYPE_CHECKING:
    from textual import events

_ACTIONS = {key: one.action for one in EVERY for key in one.keys.split(",")}
_MOVES = ("move(", "page(", "edge(", "packet(", "select(")  # after these it is only shown where one is in the end


class Pressing(Offering):
    """The part of the browser that takes keys. Textual hands them on to widgets, where they overtake each other."""

    async def on_event(self, event: events.Event) -> None:
        """Take keys, and what is pasted, as they come."""
        if isinstance(event, Key) and not event.is_forwarded:
            self.app_focus = True
            await self._press(event)
        elif isinstance(event, Paste) and self.focused is self.bar:
            self.bar.replace(" ".join(event.text.split()), *self.bar.selection)
        else:
            await super().on_event(event)

    async def _press(self, event: Key) -> None:
        if self.chord:
            self._end_chord(event.key)
            return
        if (self.focused is self.bar and self._typed(event)) or await self._check_bindings(event.key, priority=True):
            return
        page = self.screen
        if isinstance(page, ScreenPage):
            page.take(event)
            if page.chosen:
                await self.run_action(page.chosen)
        elif self.focused is self.bar:
            await self._check_bindings(event.key)
        elif action := _ACTIONS.get(event.key):
            self.forget_said()
            if not action.startswith(_MOVES):
                self.settle()
            await self.run_action(action)

    def _end_chord(self, key: str) -> None:
        chord, self.chord = self.chord, ""
        if chord in ("apply", "prepare"):
            self.combine(chord, key)
        elif chord == "copy":
            self.copy(key)
        else:
            self.follow(key)

    def _typed(self, event: Key) -> bool:
        """Return whether a key was one for the line that is typed in, and done."""
        bar = self.bar
        if event.key == "enter":
            self.submit()
        elif event.key in ("escape", "ctrl+c"):
            self.leave_bar()
        elif event.key == "tab":
            if offered := bar.complete():
                self.say(offered, "dim")
        elif event.key in ("up", "down"):
            bar.older(1 if event.key == "up" else -1)
        elif event.is_printable and event.character is not None:
            bar.replace(event.character, *bar.selection)
        else:
            return False
        return True

    def settle(self) -> None:
        """Show the row and the field that one has gone to, if that is still to be done."""
        row = self.view.current()
        if row is not None and (self.shown is None or self.shown.row != row):
            self.show_row()
        if self.focused is self.bytes:
            self.select_by_byte()
