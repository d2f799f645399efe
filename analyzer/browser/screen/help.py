"""The page of keys."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from textual.screen import ModalScreen

from analyzer.browser.screen.keys import help_lines
from analyzer.browser.screen.lines import Lines
from analyzer.browser.screen.styles import NAMED

if TYPE_CHECKING:
    from textual.app import ComposeResult
    from textual.events import Key

_SIGNS = (
    ("m c * e", "in front of a row: a mark, a comment, a rule names it, an event or a flight's begin or end"),
    ("> 1-6", "it is selected; of which coloured conversation it is"),
    ("! ? o 1", "in the strip: findings (error, warning), marks, where a flight begins; coloured: in flight"),
)  # fmt: skip
_KEY = 11


class HelpPage(ModalScreen[None]):
    """All keys; arrows scroll, any other key goes back."""

    CSS: ClassVar[str] = "HelpPage { background: ansi_default; } #help { height: 100%; }"

    def __init__(self) -> None:
        super().__init__()
        self._top = 0

    def compose(self) -> ComposeResult:
        """Lay out one widget."""
        yield Lines("help")

    def on_mount(self) -> None:
        """Show the text."""
        self.call_after_refresh(self._draw)

    def on_resize(self) -> None:
        """Draw as large as it is now."""
        self.call_after_refresh(self._draw)

    def _draw(self) -> None:
        rows = [*help_lines(), ("", "Signs"), *_SIGNS]
        height = self.size.height
        self._top = max(0, min(self._top, len(rows) - (height - 2)))
        lines = []
        for key, words in rows[self._top : self._top + height - 2]:
            lines.append(
                ((f" {key:<{_KEY}}", NAMED["bold"]), (words, NAMED[""])) if key else ((f" {words}", NAMED["head"]),)
            )
        more = "up, down: more; " if len(rows) > height - 2 else ""
        title = ((" Keys of tailbyte view", NAMED["title"]),)
        self.query_one(Lines).put([title, *lines, ((f" {more}any other key goes back", NAMED["dim"]),)])

    def on_key(self, event: Key) -> None:
        """Scroll, or go back."""
        event.stop()
        steps = {"up": -1, "down": 1, "pageup": -20, "pagedown": 20, "k": -1, "j": 1}
        if event.key in steps:
            self._top += steps[event.key]
            self._draw()
        else:
            self.dismiss()
