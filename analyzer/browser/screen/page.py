"""A page before the panes. It is left once: keys that come behind that are for whatever is there then."""

from __future__ import annotations

from typing import TYPE_CHECKING

from textual.events import Key
from textual.screen import ModalScreen

from analyzer.browser.screen.lines import Lines

if TYPE_CHECKING:
    from textual.app import ComposeResult

_STEPS = {"up": -1, "down": 1, "pageup": -20, "pagedown": 20, "k": -1, "j": 1, "home": -99_999, "end": 99_999}


class Page(ModalScreen[str]):
    """Lines over the whole terminal; ends with an action to be done, empty for none."""

    CSS = "Page { background: ansi_default; } #page { height: 100%; }"

    def compose(self) -> ComposeResult:
        """Lay out one widget."""
        yield Lines("page")

    def on_mount(self) -> None:
        """Show the lines."""
        self.call_after_refresh(self.draw)

    def on_resize(self) -> None:
        """Draw as large as it is now."""
        self.call_after_refresh(self.draw)

    def on_key(self, event: Key) -> None:
        """Move, or do what the key is for."""
        event.stop()
        if not self.is_current:
            self.app.post_message(Key(event.key, event.character))
        elif event.key in _STEPS:
            self.move(_STEPS[event.key])
        else:
            self.pressed(event)

    def on_mouse_scroll_down(self) -> None:
        """Go on."""
        self.move(3)

    def on_mouse_scroll_up(self) -> None:
        """Go back."""
        self.move(-3)

    def leave(self, action: str = "") -> None:
        """Go back to the panes."""
        if self.is_current:
            self.dismiss(action)

    def draw(self) -> None:
        """Draw what is seen."""
        raise NotImplementedError

    def move(self, by: int) -> None:
        """Go so many lines further."""
        raise NotImplementedError

    def pressed(self, event: Key) -> None:
        """Take any other key."""
        raise NotImplementedError
