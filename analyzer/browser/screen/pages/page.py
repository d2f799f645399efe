"""A page before the panes."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from textual.screen import ModalScreen

from analyzer.browser.screen.lines import Lines

if TYPE_CHECKING:
    from textual.app import ComposeResult
    from textual.events import Key

    from analyzer.browser.screen.lines import Spans

_STEPS = {"up": -1, "down": 1, "pageup": -20, "pagedown": 20, "k": -1, "j": 1, "home": -99_999, "end": 99_999}


class ScreenPage(ModalScreen[None]):
    """Lines over the whole terminal; `chosen` is the action that it ended with, empty for none."""

    CSS: ClassVar[str] = "Page { background: ansi_default; } #page { height: 100%; }"

    def __init__(self) -> None:
        super().__init__()
        self._lines, self.chosen = Lines("page"), ""

    def compose(self) -> ComposeResult:
        """Lay out one widget."""
        yield self._lines

    def on_mount(self) -> None:
        """Show the lines."""
        self.call_after_refresh(self.draw)

    def on_resize(self) -> None:
        """Draw as large as it is now."""
        self.call_after_refresh(self.draw)

    def take(self, event: Key) -> None:
        """Move, or do what the key is for."""
        if event.key in _STEPS:
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
        """Go back to the panes, once."""
        if self.app.screen is self:
            self.chosen = action
            self.dismiss()

    def draw(self) -> None:
        """Draw what is seen, once it is known how much that may be."""
        if self.size:
            self._lines.put(self.shown(*self.size))

    def shown(self, width: int, height: int) -> list[Spans]:
        """Return the lines that fit."""
        raise NotImplementedError

    def move(self, by: int) -> None:
        """Go so many lines further."""
        raise NotImplementedError

    def pressed(self, event: Key) -> None:
        """Take any other key."""
        raise NotImplementedError
